"""NDT, voxel Gaussians against voxel Gaussians: Stoyanov et al. 2012."""

from collections.abc import Iterator
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
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import Stage, minimise_staged, with_tolerance
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.registration.methods.scales import dense_scales
from scanlock.registration.methods.voxel_scan import VoxelScan, prepare_voxels, require_widths

Meeting = Literal["nearest", "cells-around", "all"]
"""Which Gaussians of the target one of the source meets.

``"nearest"`` the one with the nearest mean (the paper), ``"cells-around"`` those of the cells
around its own (the code that its authors published), ``"all"`` every one within reach of the
score; only the last is continuous.
"""


@dataclass(frozen=True, kw_only=True, slots=True)
class NdtD2d(Method[VoxelScan]):
    """Settings of NDT-D2D; `prepare` each scan once, `align` as many pairs as wanted."""

    cell_sizes: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0, 1.0)
    """Sides of the voxels [m]; coarsest first, each width from the pose of the last.

    The first sets the basin, the last the precision; a width is passed over where most points of
    either scan lie in cells of too few.
    """

    association: Meeting = "all"
    """Which Gaussians of the target one of the source meets."""

    neighbour_cells: int = 2
    """How many cells away Gaussians still meet, where cells around do; 2 as published."""

    shape: ScoreShape = field(default_factory=lambda: ScoreShape(sharpness=0.3))
    """The score of a pair; smaller sharpness widens the basin, and lets far pairs pull at the pose
    and cost time."""

    weight_power: float = 0.25
    """Gaussians weigh as their counts to this power; all alike (0) in the paper."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """What becomes of the points of a voxel."""

    solver: Solver = field(default_factory=Newton)
    """Minimises at each width."""

    coarse_tolerance: float = 0.01
    """All widths but the last stop at steps below this share of theirs: the next one goes on."""

    def __post_init__(self) -> None:
        require_widths(self.cell_sizes)
        if self.association not in get_args(Meeting):
            raise InvalidInput(
                f"meeting must be one of {', '.join(get_args(Meeting))}, got {self.association!r}"
            )
        require_count("neighbour_cells", self.neighbour_cells, 0)
        require_at_least("weight_power", self.weight_power, 0.0)
        require_fraction("loose_step", self.coarse_tolerance)

    @classmethod
    def stoyanov2012(cls) -> "NdtD2d":
        """Return the settings of the code that Stoyanov et al. published with their paper.

        Cells of 2, 1 and 0.5 m, the Gaussians up to two cells away, a sharpness of 0.05, steps
        down to 1 mm, at most 30 at a width. Their line search is not the solver here.
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
        """Measured on simulated pairs; see `benchmarks/uncertainty`."""
        return 0.86

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> VoxelScan:
        """Return what the method keeps of a scan."""
        return prepare_voxels(cloud, self.grid, self.cell_sizes, log)

    def align(
        self,
        target: VoxelScan,
        source: VoxelScan,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Return the pose that carries the source onto the target, from a start."""
        return minimise_staged(self._stages(target, source, constraints), start or Pose.identity())

    def _stages(
        self, target: VoxelScan, source: VoxelScan, constraints: Constraints
    ) -> Iterator[Stage]:
        scales = dense_scales(target, source)
        for scale in scales:
            stays, moves = target.voxels[scale], source.voxels[scale]
            loose = 0.0 if scale == scales[-1] else self.coarse_tolerance * stays.size
            objective = GaussiansToGaussians(
                target=stays.gaussians,
                source=moves.gaussians,
                shape=self.shape,
                weight_power=self.weight_power,
                curvature=self.solver.curvature,
                candidates=self._candidates(stays),
            )
            yield with_tolerance(self.solver, loose), constraints.applied_to(objective)

    def _candidates(self, target: VoxelGaussians) -> Association | None:
        if self.association == "nearest":
            return NearestAssociation(PointTree.from_points(target.gaussians.means))
        if self.association == "cells-around":
            return NeighbourCells(target, self.neighbour_cells)
        return None
