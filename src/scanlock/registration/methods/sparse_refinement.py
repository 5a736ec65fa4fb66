"""Refinement of a pose of sparse clouds: every point against a plane of the other cloud around it.

Cells that hold enough points of a sparse cloud are larger than the shapes of its surface, and where
their borders fall changes the pose. Planes around the points themselves have no borders. Both
clouds are noisy, so planes are fitted to either of them around the points of the other one, and
anew after each step.
"""

from dataclasses import dataclass, field, replace

import numpy as np

from scanlock.arrays import Points, Vector, frozen, read_only, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.weighted_planes import WeightedPlanes
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.point_pairs import PointPairs, plane_precisions
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.registration.methods.icp.correspondences import MIN_CORRESPONDENCES

_DEVIATION_OVER_MEDIAN = 1.4826
"""Standard deviation of a Gaussian over the median of its absolute value."""

_SHARE_OF_ALL = 0.3
"""Share of the variance of all residuals in that of one plane. Its own variance comes from about
six effective points, and three parameters were fitted to them."""

_MIN_VARIANCE = 1e-4
"""Minimum of the variance of all residuals [m^2], which is zero for identical clouds."""

_COVARIANCE_FACTOR = 1.4
"""Ratio of the actual standard deviations to the estimated ones, measured on halves of four
airborne tiles with eight seeds each: the square root of a sixth of the mean normalised squared
error. Normals of few points are noisy, and noise counts as information on horizontal shifts."""


@dataclass(frozen=True, slots=True, eq=False)
class SparseScan:
    """A cloud prepared for the refinement.

    Attributes
    ----------
    tree : PointTree
        All points.
    queries : (n, 3) [m]
        Points around which planes are fitted to the other cloud.
    """

    tree: PointTree
    queries: Points

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.queries)


@dataclass(frozen=True, kw_only=True, slots=True)
class SparseRefinement:
    """Settings of the refinement; `prepare` each cloud once, `align` any pair.

    Lengths are in units of the length scale of the pair.
    """

    neighbours: int = 10
    """Number of nearest points of a plane; the farthest has no weight."""

    max_distance: float = 2.0
    """Maximum distance of these points [m]."""

    voxel_size: float = 0.1
    """Voxel size for downsampling [m]. It hardly changes a sparse cloud; the planes of a dense one
    get the size of those of the sparse one."""

    max_points: int = 10_000
    """Maximum number of points of a cloud around which planes are fitted. With 10,000 the pose is
    known to some hundredths of their spacing."""

    cauchy_scale: float = 2.0
    """Residual with a weight of one half, in standard deviations. Points of changed surfaces and
    of leaves lie farther from a plane."""

    solver: Solver = field(
        default_factory=lambda: LevenbergMarquardt(
            criteria=ConvergenceCriteria(step_tolerance=1e-4, max_iterations=5)
        )
    )
    """Solver for the pose with fixed planes."""

    step_tolerance: float = 2e-3
    """Change of the pose by new planes at which the refinement stops [m], with rotations scaled to
    metres."""

    max_iterations: int = 15
    """Maximum number of times that planes are fitted."""

    rotation_scale: float = 20.0
    """Distance at which a rotation counts as a translation [m]."""

    def __post_init__(self) -> None:
        require_count("neighbours", self.neighbours, 6)
        require_count("max_points", self.max_points)
        require_count("max_iterations", self.max_iterations)
        for name in ("max_distance", "voxel_size", "step_tolerance", "rotation_scale"):
            require_positive(name, getattr(self, name), unit="m")
        require_positive("cauchy_scale", self.cauchy_scale)

    def prepare(self, cloud: PointCloud) -> SparseScan | None:
        """Build the tree of a cloud and choose the points around which planes are fitted.

        None for a cloud without points.
        """
        if len(cloud.measured_points) == 0:
            return None
        tree = PointTree.from_points(voxel_means(cloud.measured_points, self.voxel_size))
        if len(tree) <= self.max_points:
            return SparseScan(tree, tree.points)
        # Neighbours in memory are neighbours in space, so these are evenly distributed.
        rows = np.linspace(0, len(tree) - 1, self.max_points).astype(np.int64)
        return SparseScan(tree, read_only(tree.points[rows]))

    def align(
        self,
        target: SparseScan,
        source: SparseScan,
        start: Pose,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Refine a pose, target from source, that is right within about a spacing.

        The solution has the reason ``EMPTY_OBJECTIVE`` with fewer than 10 planes.
        """
        found = Solution(
            start, Quadratic(0.0, np.zeros(6), np.zeros((6, 6))), StopReason.ITERATION_LIMIT, ()
        )
        history: list[Iteration] = []
        for _ in range(self.max_iterations):
            pairs = self._pairs(target, source, found.pose)
            if pairs.count < MIN_CORRESPONDENCES:
                return replace(found, reason=StopReason.EMPTY_OBJECTIVE, history=tuple(history))
            objective = constraints.applied_to(pairs)
            solution = self.solver.minimise(objective, found.pose)
            history += [replace(one, pairs=pairs.count) for one in solution.history]
            step = found.pose.scaled_distance(solution.pose, self.rotation_scale)
            is_last = step < self.step_tolerance
            reason = StopReason.STEP_SMALL if is_last else StopReason.ITERATION_LIMIT
            found = replace(
                solution,
                reason=reason,
                history=tuple(history),
                objective=objective,
                covariance_factor=_COVARIANCE_FACTOR,
            )
            if is_last:
                break
        return found

    def _pairs(self, target: SparseScan, source: SparseScan, pose: Pose) -> PointPairs:
        """Return the weighted pairs of points and planes at a pose, those of both clouds."""
        to_source = pose.inverse()
        of_target = self._planes(pose.apply(source.queries), target.tree)
        of_source = self._planes(to_source.apply(target.queries), source.tree)
        forward, backward = of_target.is_plane, of_source.is_plane
        ends = np.concatenate([of_target.means[forward], target.queries[backward]])
        begins = np.concatenate([source.queries[forward], of_source.means[backward]])
        normals = np.concatenate(
            [of_target.normals[forward], of_source.normals[backward] @ pose.rotation.T]
        )
        variances = np.concatenate([of_target.variances[forward], of_source.variances[backward]])
        residuals = ((pose.apply(begins) - ends) * normals).sum(axis=1)
        rows = read_only(np.arange(len(ends)))
        precisions = plane_precisions(normals, self._weights(residuals, variances))
        return PointPairs(
            target=read_only(ends),
            source=read_only(begins),
            target_rows=rows,
            source_rows=rows,
            precisions=read_only(precisions),
            curvature=self.solver.curvature,
        )

    def _planes(self, positions: Points, tree: PointTree) -> WeightedPlanes:
        return WeightedPlanes.around(positions, tree, self.neighbours, self.max_distance)

    def _weights(self, residuals: Vector, variances: Vector) -> Vector:
        """Return the weights of residuals [1/m^2], from the variances of their planes."""
        if len(residuals) == 0:
            return residuals
        of_all = (_DEVIATION_OVER_MEDIAN * float(np.median(np.abs(residuals)))) ** 2
        of_each = variances + _SHARE_OF_ALL * max(of_all, _MIN_VARIANCE)
        return 1.0 / (of_each + (residuals / self.cauchy_scale) ** 2)
