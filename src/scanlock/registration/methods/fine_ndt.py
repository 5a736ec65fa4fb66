"""Fine NDT: D2D over small cells of whole scans, ground included, from a pose close by.

Clusters constrain a pose to centimetres, and height, roll and pitch weakly. Cells of a metre over
whole scans are flat nearly everywhere. Thousands of flat Gaussians constrain all six directions to
millimetres, from a pose within one or two cells.
"""

from dataclasses import dataclass, field, replace

from scanlock.arrays import Points, frozen, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import minimise_staged
from scanlock.registration.methods.gaussian_scan import MIN_COVERAGE
from scanlock.segmentation.cluster_gaussians import MIN_GAUSSIANS
from scanlock.threads import parallel_map


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class FineNdtScan:
    """The cells of a scan.

    Attributes
    ----------
    points : (n, 3) [m]
        All measured points.
    cell_size : float [m]
        Side of the cells.
    gaussians : Gaussians
        Gaussians of the cells of all grids.
    first_grid : Gaussians
        Gaussians of the cells of the first grid only.
    is_sparse : bool
        Whether the settings for sparse clouds apply.
    grid_count : int
        Number of grids.
    """

    points: Points
    cell_size: float
    gaussians: Gaussians
    first_grid: Gaussians
    is_sparse: bool = False
    grid_count: int = 1

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.points)


@dataclass(frozen=True, kw_only=True, slots=True)
class FineNdt:
    """Settings of fine NDT; `prepare` each scan once, `align` any pair."""

    cell_sizes: tuple[float, ...] = (1.0, 2.0, 4.0)
    """Sides of the cells [m], smallest first. Each scan takes the first size at which most of its
    points lie in cells with a Gaussian; a pair takes the larger one of its scans."""

    sparse_cell_sizes: tuple[float, ...] = (1.5, 3.0, 6.0)
    """Sides of the cells of sparse clouds [m], see `PointCloud.is_sparse`."""

    offsets: tuple[float, ...] = (0.0, 1.0 / 3.0, 2.0 / 3.0)
    """Offsets of the grids along each axis as fractions of the cell size. A surface divided badly
    by one grid is divided well by another."""

    shapes: tuple[ScoreShape, ...] = (
        ScoreShape(sharpness=0.5, window_start=4.0, window_end=9.0),
        ScoreShape(sharpness=1.0, window_start=4.0, window_end=9.0),
    )
    """Shapes of the score, one after the other. All but the last use the first grid only; the last
    one uses all grids. Distant Gaussians are cut off early: they cost time and constrain little."""

    sparse_shapes: tuple[ScoreShape, ...] = (
        ScoreShape(sharpness=0.5, window_start=4.0, window_end=9.0),
        ScoreShape(sharpness=0.5, window_start=9.0, window_end=18.0),
    )
    """Shapes of the score if either cloud is sparse. Their Gaussians have few points, and a sharper
    score has minima where the noise of these points agrees."""

    max_cells: int = 3500
    """Maximum number of Gaussians of the source for each grid, those of the most points first.
    Scans of vehicles have up to 3000."""

    max_points: int = 800_000
    """Maximum number of points of a cloud with all grids. A larger one has the first grid only,
    whose cells are enough for a pose, to save memory."""

    weight_power: float = 0.25
    """Exponent of the number of points in the weight of a Gaussian."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """Settings of the Gaussian of a cell."""

    sparse_grid: VoxelGrid = field(default_factory=lambda: VoxelGrid(min_points=4))
    """Settings of the Gaussian of a cell of a sparse cloud. Fewer points leave fewer gaps."""

    solver: Solver = field(
        default_factory=lambda: Newton(criteria=ConvergenceCriteria(step_tolerance=1e-3))
    )
    """Solver of each shape. After a Newton step of 1 mm the remaining error is about 2 um."""

    coarse_tolerance: float = 0.03
    """Step tolerance of all shapes but the last [m]."""

    def __post_init__(self) -> None:
        for name in ("cell_sizes", "sparse_cell_sizes"):
            sizes = getattr(self, name)
            if not sizes or list(sizes) != sorted(sizes):
                raise InvalidInput(f"{name} must be ascending and not empty, got {sizes}")
            for size in sizes:
                require_positive(name, size, unit="m")
        for name in ("offsets", "shapes", "sparse_shapes"):
            if not getattr(self, name):
                raise InvalidInput(f"{name} must not be empty")
        require_positive("weight_power", self.weight_power)
        require_count("max_cells", self.max_cells, MIN_GAUSSIANS)
        require_count("max_points", self.max_points, 0)
        require_positive("coarse_tolerance", self.coarse_tolerance, unit="m")

    def prepare(self, cloud: PointCloud) -> FineNdtScan:
        """Compute the cells of a cloud at the smallest size that its density allows."""
        points, is_sparse = cloud.measured_points, cloud.is_sparse
        smallest, *others = self.sparse_cell_sizes if is_sparse else self.cell_sizes
        scan = self._scan(points, smallest, is_sparse)
        for larger in others:
            coverage = scan.gaussians.counts.sum() / max(1, scan.grid_count * len(points))
            if coverage >= MIN_COVERAGE and len(scan.gaussians) >= MIN_GAUSSIANS:
                break
            scan = self._scan(points, larger, is_sparse)
        return scan

    def align(
        self,
        target: FineNdtScan,
        source: FineNdtScan,
        start: Pose,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Estimate the pose, target from source, from a start within one or two cells."""
        cell_size = max(target.cell_size, source.cell_size)
        target, source = self._with_size(target, cell_size), self._with_size(source, cell_size)

        def objective(shape: ScoreShape, is_last: bool) -> Objective:
            fixed, moving = (
                scan.gaussians if is_last else scan.first_grid for scan in (target, source)
            )
            grids = source.grid_count if is_last else 1
            score = GaussiansToGaussians(
                target=fixed,
                source=moving.with_most_points(grids * self.max_cells),
                shape=shape,
                weight_power=self.weight_power,
                curvature=self.solver.curvature,
            )
            return constraints.applied_to(score)

        is_sparse = target.is_sparse or source.is_sparse
        *first, last = self.sparse_shapes if is_sparse else self.shapes
        objectives = [*(objective(shape, False) for shape in first), objective(last, True)]
        tolerances = [self.coarse_tolerance] * len(objectives)
        return minimise_staged(self.solver, objectives, tolerances, start)

    def _with_size(self, scan: FineNdtScan, cell_size: float) -> FineNdtScan:
        if scan.cell_size == cell_size:
            return scan
        return self._scan(scan.points, cell_size, scan.is_sparse)

    def _scan(self, points: Points, cell_size: float, is_sparse: bool) -> FineNdtScan:
        grid = self.sparse_grid if is_sparse else self.grid
        offsets = self.offsets if len(points) <= self.max_points else self.offsets[:1]
        grids = parallel_map(
            lambda offset: replace(grid, offset=offset).gaussians(points, cell_size).gaussians,
            offsets,
        )
        return FineNdtScan(
            points=points,
            cell_size=cell_size,
            gaussians=Gaussians.joined(grids) if len(grids) > 1 else grids[0],
            first_grid=grids[0],
            is_sparse=is_sparse,
            grid_count=len(grids),
        )
