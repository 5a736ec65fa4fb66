"""Generalised ICP: Segal, Haehnel and Thrun 2009, and by the voxel, Koide et al. 2021."""

import math
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from scanlock.clouds.cached_neighbours import cached_neighbours
from scanlock.clouds.neighbours import NearestNeighbours
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.surface_points import SurfacePoints, SurfaceVoxels
from scanlock.models.surfaces import Neighbourhoods, SurfaceShape, require_surface
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.distribution_pairs import DistributionPairs
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.problem import Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog

_LEAST_POINTS = 10
"""Of fewer points, or fewer pairs, no pose is worth the name."""

_FAR_SQUARED = 9.0
"""A pair of points beyond three deviations misfits no more than a point without a partner."""

_LOOSE_STEP = 0.0025
"""A coarse scale ends at steps below this share of it: the next one goes on from there."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceScan:
    """A scan ready to be registered, as target or as source.

    Attributes
    ----------
    surface : SurfacePoints
        Its thinned points, in the order of the tree.
    tree : PointTree
        Finds the closest of them.
    voxels : tuple of SurfaceVoxels
        One set for each scale, where points meet voxels.
    """

    surface: SurfacePoints
    tree: PointTree
    voxels: tuple[SurfaceVoxels, ...]


@dataclass(frozen=True, kw_only=True, slots=True)
class Gicp(Method[SurfaceScan]):
    """Settings of generalised ICP; `prepare` each scan once, `align` as many pairs as wanted."""

    search: Literal["closest", "voxel"] = "closest"
    """Each point of the source meets the closest of the target, or the voxel that it lies in."""

    max_correspondence_distances: tuple[float, ...] = (20.0, 5.0, 1.0)
    """Points this far apart or farther do not meet [m]; coarsest first, each gate from the pose
    of the last. Segal et al. call it d_max. Not for voxels: their width is their gate."""

    target_voxel_sizes: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0)
    """Sides of the voxels [m]; coarsest first, each width from the pose of the last."""

    voxel_size: float = 0.25
    """Either scan is thinned to the mean of its points in each voxel of this side [m]."""

    neighbours: int = 10
    """Nearest points, itself included, that make the surface about a point."""

    shape: SurfaceShape = "plane"
    """What the neighbours are taken for, see `scanlock.models.surfaces`."""

    max_surface_radius: float = 10.0
    """Points whose neighbours lie farther from their mean [m, root mean square] have no surface,
    and are left out: stray returns, and what sensors write where nothing returned."""

    covariance_epsilon: float = 1e-3
    """Variance across the surface, where that along it is 1 [m^2]; the paper's epsilon."""

    solver: Solver = field(
        default_factory=lambda: LevenbergMarquardt(
            criteria=ConvergenceCriteria(step_tolerance=1e-4, max_iterations=10)
        )
    )
    """Minimises over the pose while the pairs are held."""

    step_tolerance: float = 1e-3
    """The pairing ends when new pairs move the pose by less [m, rotations at the lever]."""

    max_iterations: int = 60
    """How often points are paired anew at one scale, at most."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    def __post_init__(self) -> None:
        if self.search not in ("closest", "voxel"):
            raise InvalidInput(f"meeting must be 'closest' or 'voxel', got {self.search!r}")
        for name, scales in (
            ("max_correspondence_distances", self.max_correspondence_distances),
            ("target_voxel_sizes", self.target_voxel_sizes),
        ):
            if not scales or list(scales) != sorted(scales, reverse=True):
                raise InvalidInput(f"{name} must not grow from scale to scale, got {scales}")
            for scale in scales:
                require_positive(name, scale, unit="m")
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_positive("max_surface_radius", self.max_surface_radius, unit="m")
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_count("max_iterations", self.max_iterations)
        require_positive("lever", self.rotation_scale, unit="m")
        require_surface(self.neighbours, self.shape, self.covariance_epsilon)

    @property
    def covariance_factor(self) -> float:
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return 1.10 if self.search == "closest" else 1.11

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> SurfaceScan:
        """Return what the method keeps of a scan."""
        log = log or PreparationLog()
        with log.stage("thin"):
            tree = PointTree.from_points(voxel_means(cloud.points, self.voxel_size))
            count = len(tree)
        with log.stage("surface"):
            around = Neighbourhoods.around(tree, self.neighbours)
            is_surface = around.radii <= self.max_surface_radius
            if not is_surface.all() and is_surface.any():
                rows = np.flatnonzero(is_surface)
                tree = PointTree.from_points(tree.points[rows])
                around = around.taken(rows[tree.rows])
            surface = SurfacePoints(
                tree.points, around.covariances(self.shape, self.covariance_epsilon)
            )
        with log.stage("voxels"):
            widths = self.target_voxel_sizes if self.search == "voxel" else ()
            voxels = tuple(SurfaceVoxels.from_points(surface, width) for width in widths)
        if len(surface) < _LEAST_POINTS:
            raise InsufficientData(f"has {len(surface)} surface points; {_LEAST_POINTS} are needed")
        log.note(f"{len(surface)} surface points; {count - len(tree)} outliers left out")
        return SurfaceScan(surface, tree, voxels)

    def align(
        self,
        target: SurfaceScan,
        source: SurfaceScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start.

        A start where fewer than 10 points meet is returned untouched, with NO_SUPPORT.
        """
        start = start or Pose.identity()
        *coarse, finest = self._scales
        pose, history, notes = start, list[Iteration](), tuple[str, ...]()
        closest = cached_neighbours(target.tree)
        for scale in coarse:
            solution = self._descend(scale, target, source, pose, constraints, closest)
            history.extend(solution.history)
            pose = solution.pose
        if coarse:
            before = self._misfit(target, source, start, target.tree)
            if before < self._misfit(target, source, pose, closest):
                # In a narrow place, or where little is shared, wide reaches leave a good start.
                pose = start
                notes = ("the coarse scales led away from the start and were not followed",)
        solution = self._descend(finest, target, source, pose, constraints, closest)
        is_lost = solution.reason is StopReason.EMPTY_OBJECTIVE
        return replace(
            solution,
            pose=start if is_lost else solution.pose,
            history=(*history, *solution.history),
            notes=(*notes, *solution.notes),
        )

    @property
    def _scales(self) -> tuple[float, ...]:
        return (
            self.max_correspondence_distances
            if self.search == "closest"
            else self.target_voxel_sizes
        )

    def _descend(
        self,
        scale: float,
        target: SurfaceScan,
        source: SurfaceScan,
        start: Pose,
        constraints: Constraints,
        closest: NearestNeighbours,
    ) -> Solution:
        """Pair and minimise in turn, from `start` until the pose stays, at one scale."""
        is_last = scale == self._scales[-1]
        tolerance = (
            self.step_tolerance if is_last else max(self.step_tolerance, _LOOSE_STEP * scale)
        )
        pose, history, reason = start, list[Iteration](), StopReason.ITERATION_LIMIT
        quadratic, note = Quadratic(0.0, np.zeros(6), np.zeros((6, 6))), ""
        objective: Objective | None = None
        for _ in range(self.max_iterations):
            pairs, distance = self._meet(scale, target, source, pose, closest)
            note = f"{pairs.count} pairs, {pairs.count / len(source.surface):.0%} of the source"
            if pairs.count < _LEAST_POINTS:
                history.append(Iteration(0.0, 0.0, 0.0, False, pose, distance, pairs.count))
                reason = StopReason.EMPTY_OBJECTIVE
                break
            objective = constraints.applied_to(pairs)
            solution = self.solver.minimise(objective, pose)
            first, *others = (replace(one, pairs=pairs.count) for one in solution.history)
            history += [replace(first, mean_distance=distance), *others]
            metres, radians = pose.distance(solution.pose)
            pose, quadratic = solution.pose, solution.quadratic
            if math.hypot(metres, self.rotation_scale * radians) < tolerance:
                reason = StopReason.STEP_SMALL
                break
        return Solution(pose, quadratic, reason, tuple(history), (note,), objective)

    def _misfit(
        self, target: SurfaceScan, source: SurfaceScan, pose: Pose, closest: NearestNeighbours
    ) -> float:
        """Return the mean over the source of the squared distances at the finest scale, capped."""
        pairs, _ = self._meet(self._scales[-1], target, source, pose, closest)
        capped = np.minimum(pairs.squared_distances(pose), _FAR_SQUARED)
        lonely = len(source.surface) - pairs.count
        return (float(capped.sum()) + _FAR_SQUARED * lonely) / len(source.surface)

    def _meet(
        self,
        scale: float,
        target: SurfaceScan,
        source: SurfaceScan,
        pose: Pose,
        closest: NearestNeighbours,
    ) -> tuple[DistributionPairs, float]:
        """Return the pairs at a pose, and the mean distance [m] of the closest points that met."""
        moved = pose.apply(source.surface.points)
        if self.search == "closest":
            surface = target.surface
            partners, distances = closest.nearest(moved, scale)
        else:
            voxels = target.voxels[self.target_voxel_sizes.index(scale)]
            surface, partners = voxels.surface, voxels.rows_of(moved)
            distances = np.full(len(partners), math.nan)
        pairs = DistributionPairs.at(pose, surface, source.surface, partners, self.solver.curvature)
        distance = float(distances[pairs.source_rows].mean()) if pairs.count else math.nan
        return pairs, distance
