"""Generalised ICP: Segal, Haehnel and Thrun 2009, and its voxelised form, Koide et al. 2021."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from scanlock.arrays import short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import require_count, require_fraction, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.surface_points import SurfacePoints
from scanlock.models.surfaces import Neighbourhoods, SurfaceShape, require_surface
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.distribution_pairs import DistributionPairs
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.notes import Note
from scanlock.optimisation.solvers.problem import Objective, Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import stage_tolerances
from scanlock.registration.methods.icp.correspondences import (
    MIN_CORRESPONDENCES,
    Correspondences,
    CorrespondenceSearch,
    NearestNeighbourSearch,
    SearchStage,
    VoxelSearch,
    cached_stages,
    find_correspondences,
    require_points,
    typical_spacing,
)
from scanlock.registration.methods.icp.distance_rejection import Rejection
from scanlock.registration.methods.protocol import Method, PreparationLog

_MAX_SQUARED_DISTANCE = 9.0
"""Upper bound of a squared Mahalanobis distance, and its value for points without correspondence,
in the comparison of two poses."""

_COVARIANCE_FACTORS: dict[type, float] = {NearestNeighbourSearch: 1.20, VoxelSearch: 1.11}
"""Covariance factor with each search."""


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceScan:
    """A scan prepared for generalised ICP.

    Attributes
    ----------
    surface : SurfacePoints
        Downsampled points with the covariances of their surfaces.
    stages : tuple of SearchStage
        The scan as target of each stage, coarse to fine.
    """

    surface: SurfacePoints
    stages: tuple[SearchStage, ...]

    __repr__ = short_repr


@dataclass(frozen=True, kw_only=True, slots=True)
class Gicp(Method[SurfaceScan]):
    """Settings of generalised ICP."""

    search: CorrespondenceSearch = field(default_factory=NearestNeighbourSearch)
    """Search for correspondences at each stage: the nearest target point (G-ICP), or the target
    voxel that contains the source point (VGICP)."""

    rejection: Rejection | None = None
    """Rejection of correspondences by distance; None keeps all that the search finds."""

    robust: RobustWeights = field(default_factory=RobustWeights)
    """Robust weights of the Mahalanobis distances; equal weights by default. Its scales are
    multiples of a standard deviation here, not metres."""

    voxel_size: float = 0.25
    """Voxel size for downsampling both scans [m]."""

    neighbours: int = 10
    """Number of nearest points, itself included, for the covariance of the surface at a point."""

    shape: SurfaceShape = "plane"
    """Shape of the covariances, see `scanlock.models.surfaces`."""

    max_surface_radius: float = 10.0
    """Maximum root mean square distance of the neighbours of a point from their mean [m]. Points
    above it are outliers and are removed."""

    covariance_epsilon: float = 1e-3
    """Variance across the surface, relative to a variance of 1 m^2 along it; the paper's
    epsilon."""

    solver: Solver = field(
        default_factory=lambda: LevenbergMarquardt(
            criteria=ConvergenceCriteria(step_tolerance=1e-4, max_iterations=10)
        )
    )
    """Solver for the pose with fixed correspondences."""

    step_tolerance: float = 1e-3
    """Change of the pose by new correspondences at which the last stage stops [m], with rotations
    scaled to metres."""

    coarse_tolerance: float = 0.0025
    """Step tolerance of all stages but the last, as a ratio of their maximum distance or voxel
    size."""

    max_iterations: int = 60
    """Maximum number of correspondence updates of a stage."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]; about the range of a scan."""

    def __post_init__(self) -> None:
        require_positive("voxel_size", self.voxel_size, unit="m")
        require_positive("max_surface_radius", self.max_surface_radius, unit="m")
        require_positive("step_tolerance", self.step_tolerance, unit="m")
        require_fraction("coarse_tolerance", self.coarse_tolerance)
        require_count("max_iterations", self.max_iterations)
        require_positive("rotation_scale", self.rotation_scale, unit="m")
        require_surface(self.neighbours, self.shape, self.covariance_epsilon)

    @property
    def covariance_factor(self) -> float:
        """Calibrated on simulated pairs, see `Method.covariance_factor`."""
        return _COVARIANCE_FACTORS.get(type(self.search), 1.0)

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> SurfaceScan:
        """Downsample a scan, estimate the surface at each point and build the search."""
        log = log or PreparationLog()
        with log.stage("downsample"):
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
        with log.stage("search"):
            spacing = typical_spacing(tree) if self.rejection is not None else math.nan
            stages = self.search.stages(tree, surface, spacing)
        require_points(len(surface), "surface points")
        log.note(f"{len(surface)} surface points; {count - len(tree)} outliers removed")
        return SurfaceScan(surface, stages)

    def align(
        self,
        target: SurfaceScan,
        source: SurfaceScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Refine the initial pose at each stage, coarse to fine.

        The start is returned with the reason ``EMPTY_OBJECTIVE`` if the last stage finds fewer than
        10 correspondences with a positive weight.
        """
        start = start or Pose.identity()
        *coarse, finest = cached_stages(target.stages)
        pose, history, notes = start, list[Iteration](), tuple[Note, ...]()
        scales = [stage.scale for stage in (*coarse, finest)]
        tolerances = stage_tolerances(
            self.step_tolerance, [self.coarse_tolerance * scale for scale in scales]
        )
        for stage, tolerance in zip(coarse, tolerances, strict=False):
            solution = self._refine(stage, source, pose, constraints, tolerance)
            history.extend(solution.history)
            pose = solution.pose
        # The uncached stage for the start, which is far from the last queries of the cache.
        if coarse and (
            self._cost(target.stages[-1], source, start) < self._cost(finest, source, pose)
        ):
            # Long correspondences can draw the pose away from a good start in narrow places or
            # where the overlap is small.
            pose = start
            notes = ("the coarse stages moved away from the start and were discarded",)
        if self.rejection is not None and (note := self.rejection.note(finest.spacing)):
            notes = (*notes, note)
        solution = self._refine(finest, source, pose, constraints, self.step_tolerance)
        is_lost = solution.reason is StopReason.EMPTY_OBJECTIVE
        return replace(
            solution,
            pose=start if is_lost else solution.pose,
            history=(*history, *solution.history),
            notes=(*notes, *solution.notes),
        )

    def _refine(
        self,
        target: SearchStage,
        source: SurfaceScan,
        start: Pose,
        constraints: Constraints,
        tolerance: float,
    ) -> Solution:
        """Alternate correspondences and pose, Algorithm 1 of Segal et al., to convergence."""
        pose, history, reason = start, list[Iteration](), StopReason.ITERATION_LIMIT
        quadratic, note = Quadratic(0.0, np.zeros(6), np.zeros((6, 6))), ""
        objective: Objective | None = None
        threshold = math.inf
        for _ in range(self.max_iterations):
            found, pairs = self._pairs(target, source, pose, threshold)
            count, threshold = len(found), found.threshold
            note = f"{count} correspondences, {count / len(source.surface):.0%} of the source"
            if found.weighted_count < MIN_CORRESPONDENCES:
                history.append(Iteration(0.0, 0.0, 0.0, False, pose, found.mean_distance, count))
                reason = StopReason.EMPTY_OBJECTIVE
                break
            objective = constraints.applied_to(pairs)
            solution = self.solver.minimise(objective, pose)
            first, *others = (replace(one, pairs=count) for one in solution.history)
            history += [replace(first, mean_distance=found.mean_distance), *others]
            step = pose.scaled_distance(solution.pose, self.rotation_scale)
            pose, quadratic = solution.pose, solution.quadratic
            if step < tolerance:
                reason = StopReason.STEP_SMALL
                break
        return Solution(pose, quadratic, reason, tuple(history), (note,), objective)

    def _pairs(
        self, target: SearchStage, source: SurfaceScan, pose: Pose, previous: float
    ) -> tuple[Correspondences, DistributionPairs]:
        """Return the weighted correspondences at a pose, and their cost."""
        found = find_correspondences(
            target.closest,
            pose.apply(source.surface.points),
            self.rejection,
            max_distance=target.max_distance,
            spacing=target.spacing,
            previous=previous,
        )
        pairs = self._distributions(target, source, pose, found)
        if self.robust.loss != "none" and len(found):
            distances = np.sqrt(pairs.squared_distances(pose))
            found = found.weighted(self.robust.weights(distances))
            pairs = replace(pairs, precisions=found.weights[:, None] * pairs.precisions)
        return found, pairs

    def _distributions(
        self, target: SearchStage, source: SurfaceScan, pose: Pose, found: Correspondences
    ) -> DistributionPairs:
        """Return the unweighted cost of correspondences with the covariances at a pose."""
        rows = np.full(len(source.surface), -1, np.int64)
        rows[found.source_rows] = found.target_rows
        return DistributionPairs.at(
            pose, target.surface, source.surface, rows, self.solver.curvature
        )

    def _cost(self, target: SearchStage, source: SurfaceScan, pose: Pose) -> float:
        """Return the mean squared distance of all source points, bounded by a maximum."""
        found = find_correspondences(
            target.closest,
            pose.apply(source.surface.points),
            max_distance=target.max_distance,
        )
        squared = self._distributions(target, source, pose, found).squared_distances(pose)
        bounded = np.minimum(squared, _MAX_SQUARED_DISTANCE)
        unpaired = len(source.surface) - len(found)
        return (float(bounded.sum()) + _MAX_SQUARED_DISTANCE * unpaired) / len(source.surface)
