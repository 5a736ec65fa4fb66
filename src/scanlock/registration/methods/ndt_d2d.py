"""NDT-D2D, voxel Gaussians against voxel Gaussians: Stoyanov et al. 2012."""

from dataclasses import dataclass, field
from typing import Literal, get_args

from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput, require_at_least, require_count, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGaussians, VoxelGrid
from scanlock.optimisation.objectives.associations import (
    Association,
    NearestAssociation,
    NeighbourCells,
)
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians, ScoreShape
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

GaussianAssociation = Literal["nearest", "cells-around", "all"]
"""Association of a source Gaussian with Gaussians of the target.

``"nearest"``: the one with the nearest mean (the paper). ``"cells-around"``: those of the cells
around its own (the code published with the paper). ``"all"``: all Gaussians near enough to score.
Only the last one is continuous in the pose.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class NdtD2d(Method[GaussianScan]):
    """Settings of NDT-D2D."""

    cell_sizes: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0, 1.0)
    """Cell size at each stage [m], coarse to fine. Each stage starts from the pose of the previous
    one.

    The first size determines the basin of convergence, the last one the precision. Sizes are
    skipped at which most points of either scan lie in cells of too few points.
    """

    association: GaussianAssociation = "all"
    """Gaussians of the target against which a source Gaussian is scored."""

    neighbour_cells: int = 2
    """Radius of the association ``"cells-around"`` in cells; 2 in the published code."""

    shape: ScoreShape = field(default_factory=lambda: ScoreShape(sharpness=0.3))
    """Score of a pair of Gaussians. A smaller sharpness widens the basin of convergence, but lets
    distant pairs bias the pose and takes more time."""

    weight_power: float = 0.25
    """Exponent of the number of points in the weight of a Gaussian; 0 (equal weights) in the
    paper."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """Estimation of the Gaussian of a cell."""

    solver: Solver = field(default_factory=Newton)
    """Solver of each stage."""

    coarse_tolerance: float = 0.01
    """Step tolerance of all stages but the last, as a ratio of their cell size."""

    def __post_init__(self) -> None:
        require_coarse_to_fine("cell_sizes", self.cell_sizes)
        associations = get_args(GaussianAssociation)
        if self.association not in associations:
            raise InvalidInput(
                f"association must be one of {', '.join(associations)}, got {self.association!r}"
            )
        require_count("neighbour_cells", self.neighbour_cells, 0)
        require_at_least("weight_power", self.weight_power, 0.0)
        require_fraction("coarse_tolerance", self.coarse_tolerance)

    @classmethod
    def stoyanov2012(cls) -> "NdtD2d":
        """Return the settings of the code published with Stoyanov et al. 2012.

        Cells of 2, 1 and 0.5 m, Gaussians up to two cells away, a sharpness of 0.05, a step
        tolerance of 1 mm and at most 30 iterations at each size. The line search is ours.
        """
        return cls(
            cell_sizes=(2.0, 1.0, 0.5),
            association="cells-around",
            shape=ScoreShape(sharpness=0.05),
            weight_power=0.0,
            solver=Newton(criteria=ConvergenceCriteria(step_tolerance=1e-3, max_iterations=30)),
        )

    @property
    def covariance_factor(self) -> float:
        """Calibrated on simulated pairs, see `Method.covariance_factor`."""
        return 0.78

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> GaussianScan:
        """Estimate the Gaussians of a scan at each cell size."""
        return prepare_voxels(cloud, self.grid, self.cell_sizes, log)

    def align(
        self,
        target: GaussianScan,
        source: GaussianScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Minimise the score over the pose at each dense cell size, coarse to fine."""
        scales = dense_scales(target, source)
        sizes = [target.voxels[scale].size for scale in scales]
        return minimise_staged(
            self.solver,
            (constraints.applied_to(self._objective(target, source, scale)) for scale in scales),
            [self.coarse_tolerance * size for size in sizes],
            start or Pose.identity(),
        )

    def _objective(self, target: GaussianScan, source: GaussianScan, scale: int) -> Objective:
        return GaussiansToGaussians(
            target=target.gaussians[scale],
            source=source.gaussians[scale],
            shape=self.shape,
            weight_power=self.weight_power,
            curvature=self.solver.curvature,
            candidates=self._candidates(target.voxels[scale]),
        )

    def _candidates(self, target: VoxelGaussians) -> Association | None:
        if self.association == "nearest":
            return NearestAssociation(PointTree.from_points(target.gaussians.means))
        if self.association == "cells-around":
            return NeighbourCells(target, self.neighbour_cells)
        return None
