"""The last stage: small cells of whole scans, ground included, Gaussian against Gaussian.

Clusters hold a pose to centimetres, and leave height, roll and pitch weak. Cells of a metre over
everything that was seen are flat nearly everywhere, and thousands of flat Gaussians hold all
six directions to a millimetre, from a start within a cell or two.
"""

from dataclasses import dataclass, field, replace

from scanlock.arrays import Points, frozen
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import Stage, minimise_staged, with_tolerance
from scanlock.registration.methods.scales import MIN_COVERAGE, require_coarse_to_fine
from scanlock.registration.methods.voxel_scan import measured_points
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS
from scanlock.threads import spread


@dataclass(frozen=True, slots=True, eq=False)
class FineNdtScan:
    """The small cells of a scan.

    Attributes
    ----------
    points : (n, 3) [m]
        All measured points.
    width : float [m]
        Side of the cells: the least that most points fill.
    gaussians : Gaussians
        Those of the cells of that width, in all grids.
    coarse : Gaussians
        Those of the first grid only.
    """

    points: Points
    width: float
    gaussians: Gaussians
    coarse: Gaussians

    def __post_init__(self) -> None:
        frozen(self.points)


@dataclass(frozen=True, kw_only=True, slots=True)
class FineNdt:
    """Settings of the last stage; `prepare` each scan once, `align` as many pairs as wanted."""

    cell_sizes: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Sides of the cells [m], finest first. Each scan takes the first that most of its points
    fill, a pair the larger of its two."""

    offsets: tuple[float, ...] = (0.0, 1.0 / 3.0, 2.0 / 3.0)
    """Where the grids lie along each axis, as shares of the width; the cells of all of them are
    taken. What one grid cuts badly the next one does not."""

    shapes: tuple[ScoreShape, ...] = (
        ScoreShape(sharpness=0.5, window_start=4.0, window_end=9.0),
        ScoreShape(sharpness=1.0, window_start=4.0, window_end=9.0),
    )
    """The score of a pair, one shape after the other: the first bring the cells of one grid
    together, the last is the more exact and takes all grids. Cut off early, since far pairs cost
    time and say nothing here."""

    weight_power: float = 0.25
    """Gaussians weigh as their counts to this power."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """What becomes of the points of a cell."""

    solver: Solver = field(
        default_factory=lambda: Newton(criteria=ConvergenceCriteria(step_tolerance=1e-3))
    )
    """Minimises the score. What is left after a step of a millimetre is two thousandths of it."""

    coarse_tolerance: float = 0.03
    """All shapes but the last stop at steps below this [m]."""

    def __post_init__(self) -> None:
        require_coarse_to_fine("cell_sizes, reversed,", self.cell_sizes[::-1])
        require_at_least("offsets", len(self.offsets), 1)
        require_at_least("shapes", len(self.shapes), 1)
        require_positive("weight_power", self.weight_power)
        require_positive("loose_step", self.coarse_tolerance, unit="m")

    def prepare(self, cloud: PointCloud) -> FineNdtScan:
        """Return the cells of a cloud at the width that its density allows."""
        points = measured_points(cloud)
        found = self._cells(points, self.cell_sizes[0])
        for coarser in self.cell_sizes[1:]:
            share = found.gaussians.counts.sum() / max(1, len(self.offsets) * len(points))
            if share >= MIN_COVERAGE and len(found.gaussians) >= MIN_GAUSSIANS:
                break
            found = self._cells(points, coarser)
        return found

    def align(
        self,
        target: FineNdtScan,
        source: FineNdtScan,
        start: Pose,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start close by."""
        width = max(target.width, source.width)
        stays, moves = self._at_width(target, width), self._at_width(source, width)

        def stage(shape: ScoreShape, is_last: bool) -> Stage:
            objective = GaussiansToGaussians(
                target=stays.gaussians if is_last else stays.coarse,
                source=moves.gaussians if is_last else moves.coarse,
                shape=shape,
                weight_power=self.weight_power,
                curvature=self.solver.curvature,
            )
            solver = self.solver if is_last else with_tolerance(self.solver, self.coarse_tolerance)
            return solver, constraints.on(objective)

        *first, last = self.shapes
        stages = [*(stage(shape, False) for shape in first), stage(last, True)]
        return minimise_staged(stages, start)

    def _at_width(self, scan: FineNdtScan, width: float) -> FineNdtScan:
        return scan if scan.width == width else self._cells(scan.points, width)

    def _cells(self, points: Points, width: float) -> FineNdtScan:
        grids = spread(
            lambda offset: replace(self.grid, offset=offset).gaussians(points, width).gaussians,
            self.offsets,
        )
        return FineNdtScan(points, width, Gaussians.joined(grids), grids[0])
