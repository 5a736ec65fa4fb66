"""NDT, points against voxel Gaussians: Biber and Strasser 2003, Magnusson 2009."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal, get_args

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput, require_at_least, require_fraction
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGaussians, VoxelGrid
from scanlock.optimisation.objectives.cell_scores import CellAssociation, PointsToCells
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.objectives.gaussian_scores import PointsToGaussians, ScoreShape
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Solution
from scanlock.optimisation.solvers.solver import Solver
from scanlock.optimisation.solvers.staged import Stage, minimise_staged, with_tolerance
from scanlock.registration.methods.protocol import Method, PreparationLog
from scanlock.registration.methods.scales import dense_scales
from scanlock.registration.methods.voxel_scan import VoxelScan, prepare_voxels, require_widths

Meeting = Literal[CellAssociation, "all"]
"""A rule of `scanlock.optimisation.objectives.cell_scores`, or every Gaussian in reach."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Ndt(Method[VoxelScan]):
    """Settings of NDT; `prepare` each scan once, `align` as many pairs as wanted."""

    cell_sizes: tuple[float, ...] = (16.0, 8.0, 4.0, 2.0, 1.0)
    """Sides of the voxels [m]; coarsest first, each width from the pose of the last.

    The first sets the basin, the last the precision; a width is passed over where most points of
    the target lie in cells of too few.
    """

    association: Meeting = "near-cells"
    """Which Gaussians of the target a point of the source meets."""

    outlier_ratio: float = 0.55
    """Share of the points that come from no Gaussian; with the width, the shape of the score."""

    grid: VoxelGrid = field(default_factory=VoxelGrid)
    """What becomes of the points of a voxel."""

    voxel_size: float = 0.5
    """The mean of the source's points in each cube of this side [m] stands for them; 0 for all."""

    solver: Solver = field(default_factory=Newton)
    """Minimises at each width."""

    coarse_tolerance: float = 0.01
    """All widths but the last stop at steps below this share of theirs: the next one goes on."""

    def __post_init__(self) -> None:
        require_widths(self.cell_sizes)
        if self.association not in (*_CELL_MEETINGS, "all"):
            raise InvalidInput(
                f"meeting must be one of {', '.join(_CELL_MEETINGS)}, all, got {self.association!r}"
            )
        ScoreShape.magnusson(1.0, self.outlier_ratio)
        require_at_least("voxel_size", self.voxel_size, 0.0, unit="m")
        require_fraction("loose_step", self.coarse_tolerance)

    @classmethod
    def das2013(cls) -> "Ndt":
        """Return NDT as Das et al. 2013 compare with it: cells of 3 m, all points, stop at 1e-6.

        They ran the Point Cloud Library, and describe each point in the cell that it lies in.
        """
        solver = Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-6, step_tolerance=1e-6))
        return cls(cell_sizes=(3.0,), association="own-cell", voxel_size=0.0, solver=solver)

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> VoxelScan:
        """Return what the method keeps of a scan."""
        return prepare_voxels(cloud, self.grid, self.cell_sizes, log, self.voxel_size)

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
        scales = dense_scales(target)
        for scale in scales:
            voxels = target.voxels[scale]
            loose = 0.0 if scale == scales[-1] else self.coarse_tolerance * voxels.size
            objective = self._objective(voxels, source.points)
            yield with_tolerance(self.solver, loose), constraints.applied_to(objective)

    def _objective(self, voxels: VoxelGaussians, points: Points) -> Objective:
        shape = ScoreShape.magnusson(voxels.size, self.outlier_ratio)
        curvature = self.solver.curvature
        if self.association == "all":
            return PointsToGaussians(
                target=voxels.gaussians, points=points, shape=shape, curvature=curvature
            )
        return PointsToCells(
            target=voxels,
            points=points,
            association=self.association,
            shape=shape,
            curvature=curvature,
        )


_CELL_MEETINGS: tuple[str, ...] = get_args(CellAssociation)
