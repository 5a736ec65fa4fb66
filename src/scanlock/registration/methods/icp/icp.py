"""Iterative closest points: the algorithm of Madhavan and Messina 2003, section 2.1."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from scanlock.arrays import Points, Vector
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
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.methods.icp.annealing import AnnealedStart
from scanlock.registration.methods.icp.correspondences import (
    MIN_CORRESPONDENCES,
    Correspondences,
    PointScan,
    find_correspondences,
    require_algorithm,
    require_points,
    typical_spacing,
)
from scanlock.registration.methods.icp.distance_rejection import AdaptiveRejection, Rejection
from scanlock.registration.methods.icp.history import IcpConvergenceCriteria, IcpHistory
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.protocol import Method, PreparationLog

_EMPTY = Quadratic(0.0, np.zeros(6), np.zeros((6, 6)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Icp(Method[PointScan]):
    """Settings of ICP."""

    search: Search = "k-d tree"
    """Search for the nearest target point: a k-d tree, or the Delaunay tessellation of the
    paper."""

    max_correspondence_distance: float = 10.0
    """Maximum distance of a correspondence [m]; infinite in the paper. Points without a target
    point within it do not enter the statistics of the rejection."""

    rejection: Rejection | None = field(default_factory=AdaptiveRejection)
    """Rejection of correspondences by distance; None keeps all of them."""

    statistics_switch_step: float = 0.01
    """Step [m], with rotations scaled to metres, below which an adaptive rejection switches from
    the statistics of all correspondences to those within the previous threshold. The first have a
    wide basin of convergence, the second are precise. Infinite: switch after the first iteration,
    as in Zhang 1994."""

    max_normal_angle: float | None = None
    """Maximum angle between the surface normals of a correspondence [rad]; None for no limit. Zhang
    1994 recommends 60 degrees."""

    robust: RobustWeights = field(default_factory=RobustWeights)
    """Robust weights of the residuals; equal weights by default, as in the paper."""

    estimation: TransformEstimation = field(default_factory=TransformEstimation)
    """Transform estimation from the correspondences."""

    noise: SensorNoise | None = None
    """Noise of both sensors, which weights the correspondences; None for equal weights."""

    voxel_size: float | None = 0.5
    """Voxel size for downsampling both scans [m]; None keeps all points, as in the paper."""

    neighbours: int = 10
    """Number of nearest points, itself included, for the normal at a point."""

    criteria: IcpConvergenceCriteria = field(default_factory=IcpConvergenceCriteria)
    """Convergence criteria."""

    annealing: AnnealedStart | None = None
    """Search for further starts by simulated annealing; None uses the initial pose only."""

    @classmethod
    def madhavan2003(cls, good_distance: float | None = None) -> "Icp":
        """Return ICP as in the paper: all points, Delaunay search, statistics of all distances.

        The paper does not specify the relative change at which to stop, here 0.01 as in Zhang 1994,
        nor D.

        Parameters
        ----------
        good_distance : float, optional [m]
            D of the paper; three times the spacing of the target by default.
        """
        return cls(
            search="delaunay",
            max_correspondence_distance=math.inf,
            rejection=AdaptiveRejection(good_distance=good_distance, statistics="all"),
            voxel_size=None,
            criteria=IcpConvergenceCriteria(relative_change=0.01),
        )

    def __post_init__(self) -> None:
        require_algorithm("search", self.search)
        for name in ("max_correspondence_distance", "statistics_switch_step"):
            if getattr(self, name) != math.inf:
                require_positive(name, getattr(self, name), unit="m")
        # The sign of a normal is arbitrary, so angles above a right angle do not occur.
        if self.max_normal_angle is not None and not 0.0 < self.max_normal_angle <= math.pi / 2:
            raise InvalidInput(
                "max_normal_angle must lie above 0 and be at most pi/2, got "
                f"{self.max_normal_angle} rad"
            )
        if self.voxel_size is not None:
            require_positive("voxel_size", self.voxel_size, unit="m")
        require_count("neighbours", self.neighbours, MIN_NEIGHBOURS)

    @property
    def covariance_factor(self) -> float:
        """Calibrated on simulated pairs, see `Method.covariance_factor`."""
        return 1.86 if self.estimation.residual == "point-to-plane" else 6.0

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> PointScan:
        """Downsample a scan, build its search and estimate normals and noise if needed."""
        log = log or PreparationLog()
        with log.stage("downsample"):
            points = cloud.points
            if self.voxel_size is not None:
                points = voxel_means(points, self.voxel_size)
        with log.stage("search"):
            tree = PointTree.from_points(points)
            closest = nearest_neighbours(tree, self.search)
            spacing = typical_spacing(tree)
        normals, covariances = np.zeros((0, 3)), np.zeros((0, 6))
        with log.stage("surface"):
            if self.estimation.residual == "point-to-plane" or self.max_normal_angle is not None:
                normals = surface_normals(tree, self.neighbours)
            if self.noise is not None:
                covariances = self.noise.covariances(tree.points)
        sample = np.zeros((0, 3))
        if self.annealing is not None:
            with log.stage("sample"):
                sample = self.annealing.sample(cloud)
        require_points(len(tree))
        log.note(f"{len(tree)} points with a spacing of {cloud.scale * spacing:.3g} m")
        if self.noise is not None and cloud.origin.any():
            log.note("sensor noise is relative to the origin, which may not be the sensor")
        return PointScan(closest, spacing, normals, covariances, sample)

    def align(
        self,
        target: PointScan,
        source: PointScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Refine the initial pose, and with annealing further starts, of which the best is kept.

        The history has one entry for each iteration: its pose, and the objective and mean distance
        of the correspondences there. The start is returned with the reason ``EMPTY_OBJECTIVE`` if
        an iteration has fewer than 10 correspondences with a positive weight.
        """
        start = start or Pose.identity()
        if self.annealing is None:
            return self._refine(target, source, start, constraints)
        starts = self.annealing.starts(target, source, start, constraints)
        solutions = [self._refine(target, source, pose, constraints) for pose in starts]
        return self.annealing.best(target, source, solutions)

    def correspondences(
        self,
        target: PointScan,
        source: PointScan,
        pose: Pose,
        previous: float = math.inf,
        max_threshold: float = math.inf,
    ) -> Correspondences:
        """Return the weighted correspondences at a pose: step 1 of the paper.

        Parameters
        ----------
        target, source : PointScan
        pose : Pose
            Target from source.
        previous : float [m]
            Threshold of the previous iteration, see `Rejection.threshold`.
        max_threshold : float [m]
            Upper bound of the threshold.
        """
        points = pose.apply(source.points)
        found = find_correspondences(
            target.closest,
            points,
            self.rejection,
            max_distance=self.max_correspondence_distance,
            spacing=target.spacing,
            previous=previous,
            max_threshold=max_threshold,
        )
        if self.max_normal_angle is not None:
            cosines = _normal_cosines(target, source, pose, found)
            found = found.selected(cosines >= np.cos(self.max_normal_angle))
        if not len(found):
            return found
        return found.weighted(self.robust.weights(self._residuals(target, points, found)))

    def _refine(
        self, target: PointScan, source: PointScan, start: Pose, constraints: Constraints
    ) -> Solution:
        """Iterate the steps of Madhavan and Messina 2003, section 2.1, from a start."""
        target = replace(target, closest=cached_neighbours(target.closest))
        history = IcpHistory(start, self.estimation.rotation_scale)
        if self.rejection is not None:
            history.note(self.rejection.note(target.spacing))
        while True:
            # Step 1: pair closest points and reject pairs by the threshold of their distances.
            pose, max_threshold = history.pose, history.max_threshold
            previous = history.previous_threshold(self.statistics_switch_step)
            pairs = self.correspondences(target, source, pose, previous, max_threshold)
            if pairs.weighted_count < MIN_CORRESPONDENCES:
                history.add(_EMPTY, pairs, accepted=False)
                return history.solution(start, _EMPTY, StopReason.EMPTY_OBJECTIVE)
            # Step 2: the weighted sum of squares of eq. (2).
            objective = self.estimation.objective(target, source, pairs, pose)
            constrained = constraints.applied_to(objective)
            quadratic = constrained.linearise(pose)
            history.add(quadratic, pairs)
            # Step 4, for the previous motion: test for convergence.
            reason = self._stop_reason(history)
            if reason is not None:
                ratio = len(pairs) / len(source.points)
                history.note(f"{len(pairs)} correspondences, {ratio:.0%} of the source")
                return history.solution(pose, quadratic, reason, constrained)
            # Steps 2 and 3: estimate the transform that minimises it, and apply it.
            history.pose, note = self.estimation.next_pose(objective, quadratic, pose, constraints)
            history.note(note)

    def _stop_reason(self, history: IcpHistory) -> StopReason | None:
        """Return why to stop; None to continue, if need be with a smaller maximum threshold.

        Thresholds that alternately grow and shrink are bounded by their minimum. If poses recur
        even so, correspondences alternate between equally good points.
        """
        reason, note = self.criteria.reason(history.iterations)
        history.note(note)
        if reason is None and (length := history.cycle_length(self.criteria.step_tolerance)):
            reason = StopReason.STEP_SMALL if history.cycle_start > 0 else None
            history.break_cycle(length)
        return reason

    def _residuals(self, target: PointScan, points: Points, found: Correspondences) -> Vector:
        """Return the (m,) residuals [m] of source points in the frame of the target."""
        if self.estimation.residual == "point-to-point":
            return found.distances
        differences = points[found.source_rows] - target.points[found.target_rows]
        return np.einsum("ma,ma->m", differences, target.normals[found.target_rows])


def _normal_cosines(
    target: PointScan, source: PointScan, pose: Pose, found: Correspondences
) -> Vector:
    """Return the (m,) cosines of the angles between the normals of correspondences, unsigned."""
    rotated = source.normals[found.source_rows] @ pose.rotation.T
    return np.abs(np.einsum("ma,ma->m", rotated, target.normals[found.target_rows]))
