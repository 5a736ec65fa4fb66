"""Iterative closest points: the algorithm of Madhavan and Messina 2003, section 2.1."""

import math
from dataclasses import dataclass, field, replace
from typing import get_args

import numpy as np

from scanlock.clouds.cached_neighbours import cached_neighbours
from scanlock.clouds.neighbours import Search, nearest_neighbours
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.sensor_noise import SensorNoise
from scanlock.models.surfaces import MIN_NEIGHBOURS, surface_normals
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.correspondences import (
    MIN_CORRESPONDENCES,
    CorrespondenceFinder,
    PointScan,
    typical_spacing,
)
from scanlock.registration.methods.icp_annealing import AnnealedStart
from scanlock.registration.methods.icp_history import IcpConvergenceCriteria, IcpHistory
from scanlock.registration.methods.protocol import InsufficientData, Method, PreparationLog
from scanlock.registration.methods.rejection import AdaptiveRejection
from scanlock.registration.methods.transform_estimation import TransformEstimation


@dataclass(frozen=True, kw_only=True, slots=True)
class Icp(Method[PointScan]):
    """Settings of ICP; `prepare` each scan once, `align` as many pairs as wanted."""

    search: Search = "k-d tree"
    """How closest points are found: a k-d tree, or the paper's Delaunay tessellation."""

    correspondences: CorrespondenceFinder = field(default_factory=CorrespondenceFinder)
    """Which pairs count, and how much."""

    statistics_switch_step: float = 0.01
    """An adaptive gate looks at all pairs until the pose moves by less than this [m], rotations
    counted at the lever, and from then on at those within its last limit: a wide basin first, a
    precise end after it. With infinity it looks at the latter from the second iteration on, as
    in Zhang 1994; gates with statistics of all pairs never do."""

    estimation: TransformEstimation = field(default_factory=TransformEstimation)
    """How pairs become a motion."""

    noise: SensorNoise | None = None
    """Noise of both sensors, by which pairs are weighed; None weighs all alike."""

    voxel_size: float | None = 0.5
    """Either scan is thinned to the mean of its points in each voxel of this side [m]; None takes
    all points, as in the paper."""

    neighbours: int = 10
    """Nearest points, itself included, that make the surface about a point."""

    criteria: IcpConvergenceCriteria = field(default_factory=IcpConvergenceCriteria)
    """When to stop."""

    annealing: AnnealedStart | None = None
    """Search for starts by simulated annealing, and descend from each; None descends from the
    initial pose alone."""

    @classmethod
    def madhavan2003(cls, good_distance: float | None = None) -> "Icp":
        """Return ICP as the paper has it: all points, a Delaunay search, statistics of all pairs.

        The paper leaves open when a change is small, which is taken from Zhang 1994, and D.

        Parameters
        ----------
        good_distance : float, optional [m]
            The paper's D; three times the spacing of the target by default.
        """
        gate = AdaptiveRejection(good_distance=good_distance, statistics="all")
        return cls(
            search="delaunay",
            correspondences=CorrespondenceFinder(
                rejection=gate, max_correspondence_distance=math.inf
            ),
            voxel_size=None,
            criteria=IcpConvergenceCriteria(relative_change=0.01),
        )

    def __post_init__(self) -> None:
        if self.search not in get_args(Search):
            raise InvalidInput(
                f"search must be {' or '.join(map(repr, get_args(Search)))}, got {self.search!r}"
            )
        if self.statistics_switch_step != math.inf:
            require_positive("statistics_switch_step", self.statistics_switch_step, unit="m")
        if self.voxel_size is not None:
            require_positive("voxel_size", self.voxel_size, unit="m")
        require_count("neighbours", self.neighbours, MIN_NEIGHBOURS)

    @property
    def covariance_factor(self) -> float:
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return 1.86 if self.estimation.residual == "point-to-plane" else 4.42

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> PointScan:
        """Return what the method keeps of a scan."""
        log = log or PreparationLog()
        with log.stage("thin"):
            points = cloud.points
            if self.voxel_size is not None:
                points = voxel_means(points, self.voxel_size)
        with log.stage("search"):
            tree = PointTree.from_points(points)
            closest = nearest_neighbours(tree, self.search)
            spacing = typical_spacing(tree)
        normals, covariances = np.zeros((0, 3)), np.zeros((0, 6))
        with log.stage("surface"):
            if (
                self.estimation.residual == "point-to-plane"
                or self.correspondences.max_normal_angle is not None
            ):
                normals = surface_normals(tree, self.neighbours)
            if self.noise is not None:
                covariances = self.noise.covariances(tree.points)
        sample = np.zeros((0, 3))
        if self.annealing is not None:
            with log.stage("sample"):
                sample = self.annealing.sampled(cloud)
        if len(tree) < MIN_CORRESPONDENCES:
            raise InsufficientData(f"has {len(tree)} points; {MIN_CORRESPONDENCES} are needed")
        log.note(f"{len(tree)} points, {spacing:.3g} m apart")
        if self.noise is not None and cloud.origin.any():
            log.note("sensor noise taken about the origin, where the sensor may not be")
        return PointScan(closest, spacing, normals, covariances, sample)

    def align(
        self,
        target: PointScan,
        source: PointScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start.

        The history has one entry for each pairing: the pose of that pairing, the objective
        there, and how far apart the pairs are that count. A start where fewer than 10 points
        meet, or robust weights leave as few, is returned untouched, with NO_SUPPORT.
        """
        start = start or Pose.identity()
        if self.annealing is None:
            return self._descend(target, source, start, constraints)
        starts = self.annealing.poses(target, source, start, constraints)
        found = [self._descend(target, source, pose, constraints) for pose in starts]
        supported = [one for one in found if one.reason is not StopReason.EMPTY_OBJECTIVE]
        if not supported:
            return found[0]
        gaps = [self.annealing.trimmed_distance(target, source, one.pose) for one in supported]
        best = int(np.argmin(gaps))
        if (
            supported[0] is found[0]
            and gaps[best] >= (1.0 - self.annealing.min_improvement) * gaps[0]
        ):
            best = 0
        note = f"annealing found {len(starts) - 1} starts; trimmed distance {gaps[best]:.3g} m"
        kept = supported[best]
        return replace(kept, notes=(*kept.notes, note))

    def _descend(
        self, target: PointScan, source: PointScan, start: Pose, constraints: Constraints
    ) -> Solution:
        """Pair and fit in turn."""
        target = replace(target, closest=cached_neighbours(target.closest))
        trail = IcpHistory(self.estimation.rotation_scale)
        trail.note(self.correspondences.rejection.note(target.spacing))
        pose, most = start, math.inf
        while True:
            previous = trail.settled_limit(self.statistics_switch_step, pose)
            pairs = self.correspondences.find(
                target, source, pose, previous, most, self.estimation.residual
            )
            if pairs.effective < MIN_CORRESPONDENCES:
                trail.add(_NOTHING, pose, pairs, accepted=False)
                return trail.solution(start, _NOTHING, StopReason.EMPTY_OBJECTIVE)
            objective = self.estimation.objective(target, source, pairs, pose)
            restrained = constraints.applied_to(objective)
            quadratic = restrained.linearise(pose)
            trail.add(quadratic, pose, pairs)
            reason, note = self.criteria.reason(trail.history)
            if reason is None and (period := trail.period(self.criteria.step_tolerance)):
                # Limits that grow and shrink in turn are held at their least; what comes back
                # even so are pairs that change sides, for ever.
                reason = StopReason.STEP_SMALL if most < math.inf else None
                most = min(trail.limits[-period:])
                trail.hold()
                note = f"the same pairs came back: limit held at {most:.3g} m"
            trail.note(note)
            if reason is not None:
                share = len(pairs) / len(source.points)
                trail.note(f"{len(pairs)} pairs, {share:.0%} of the source")
                return trail.solution(pose, quadratic, reason, restrained)
            pose, note = self.estimation.next_pose(objective, quadratic, pose, constraints)
            trail.note(note)


_NOTHING = Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))
