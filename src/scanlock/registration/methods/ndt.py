"""NDT, points against voxel Gaussians: Biber and Strasser 2003, Magnusson 2009."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_at_least, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.cell_scores import CellAssociation, PointsToCells
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import PointsToGaussians, ScoreShape
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import minimise_staged
from scanlock.registration.methods.gaussian_scan import (
    GaussianScan,
    dense_scales,
    require_coarse_to_fine,
)
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.registration.methods.voxel_scan import prepare_voxels

PointAssociation = Literal[CellAssociation, "all"]
"""Association of a source point with Gaussians of the target.

A rule of `scanlock.optimisation.objectives.cell_scores`, or all Gaussians near enough to score.
"""

_ASSOCIATIONS: tuple[str, ...] = (*get_args(CellAssociation), "all")


@dataclass(frozen=True, kw_only=True, slots=True)
class Ndt(Method[GaussianScan]):
    """Settings of NDT."""

    cell_sizes: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0, 1.0)
    """Cell size at each stage [m], coarse to fine. Each stage starts from the pose of the previous
    one.

    The first size determines the basin of convergence, the last one the precision. Sizes are
    skipped at which most points of the target lie in cells of too few points.
    """

    association: PointAssociation = "near-cells"
    """Gaussians of the target against which a source point is scored."""

    outlier_ratio: float = 0.55
    """Ratio of points that belong to no Gaussian. Determines the score together with the size."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """Estimation of the Gaussian of a cell."""

    voxel_size: float = 0.5
    """Voxel size for downsampling the source [m]; 0 keeps all points."""

    solver: Solver = field(default_factory=Newton)
    """Solver of each stage."""

    coarse_tolerance: float = 0.01
    """Step tolerance of all stages but the last, as a ratio of their cell size."""

    def __post_init__(self) -> None:
        require_coarse_to_fine("cell_sizes", self.cell_sizes)
        if self.association not in _ASSOCIATIONS:
            raise InvalidInput(
                f"association must be one of {', '.join(_ASSOCIATIONS)}, got {self.association!r}"
            )
        ScoreShape.magnusson(1.0, self.outlier_ratio)
        require_at_least("voxel_size", self.voxel_size, 0.0, unit="m")
        require_fraction("coarse_tolerance", self.coarse_tolerance)

    @classmethod
    def das2013(cls) -> "Ndt":
        """Return NDT as in the comparison of Das et al. 2013.

        Cells of 3 m, all points, tolerances of 1e-6. They used the Point Cloud Library, and
        describe that each point is scored in the cell that contains it.
        """
        solver = Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-6, step_tolerance=1e-6))
        return cls(cell_sizes=(3.0,), association="own-cell", voxel_size=0.0, solver=solver)

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> GaussianScan:
        """Estimate the Gaussians of a scan at each cell size, and downsample its points."""
        return prepare_voxels(cloud, self.grid, self.cell_sizes, log, self.voxel_size)

    def align(
        self,
        target: GaussianScan,
        source: GaussianScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Minimise the score over the pose at each dense cell size, coarse to fine."""
        scales = dense_scales(target)
        sizes = [target.voxels[scale].size for scale in scales]
        return minimise_staged(
            self.solver,
            (constraints.applied_to(self._objective(target, source, scale)) for scale in scales),
            [self.coarse_tolerance * size for size in sizes],
            start or Pose.identity(),
        )

    def _objective(self, target: GaussianScan, source: GaussianScan, scale: int) -> Objective:
        voxels = target.voxels[scale]
        shape = ScoreShape.magnusson(voxels.size, self.outlier_ratio)
        curvature = self.solver.curvature
        if self.association == "all":
            return PointsToGaussians(
                target=voxels.gaussians, points=source.points, shape=shape, curvature=curvature
            )
        return PointsToCells(
            target=voxels,
            points=source.points,
            association=self.association,
            shape=shape,
            curvature=curvature,
        )
