"""NDT scores over the cells near a point: P2D of Biber, Magnusson and the libraries."""

from dataclasses import dataclass, field
from functools import partial
from typing import Literal, get_args

import numpy as np

from scanlock.arrays import Labels, Points, Vector, read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.cells import cell_terms, trilinear_terms
from scanlock.models.voxel_gaussians import VoxelGaussians
from scanlock.optimisation.objectives.gaussian_scores import ScoreShape
from scanlock.optimisation.solvers.problem import (
    Contributions,
    Curvature,
    Quadratic,
    contributions_of_rows,
)

CellAssociation = Literal["own-cell", "seven-cells", "near-cells", "trilinear"]
"""Cells of the target that a point of the source is associated with.

``"own-cell"``: the cell that contains the point (Biber and Strasser 2003; NDT in Das et al. 2013).
``"seven-cells"``: the own cell and those that share a face with it.
``"near-cells"``: the cells whose mean lies within one cell size (Point Cloud Library).
``"trilinear"``: the 8 cells whose centres surround the point, with weights that fall to 0 at the
distance where a cell drops out (Magnusson et al. 2007). Only this one is continuous, and its
slope still jumps.
"""

CELL_ASSOCIATIONS: tuple[CellAssociation, ...] = get_args(CellAssociation)
"""All cell associations."""

_AROUND = np.indices((3, 3, 3)).reshape(3, 27).T - 1

_OFFSETS: dict[str, Labels] = {
    "own-cell": read_only(np.zeros((1, 3), np.int64)),
    "seven-cells": read_only(_AROUND[np.abs(_AROUND).sum(axis=1) <= 1].astype(np.int64)),
    "near-cells": read_only(_AROUND.astype(np.int64)),
}


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PointsToCells:
    """P2D score: every point of the source against the Gaussians of the cells around it.

    The value is minus the mean over the points of the sum of ``rho`` over the associated cells.
    It jumps where a point changes its cells, and is twice differentiable in between.

    Attributes
    ----------
    target : VoxelGaussians
        Gaussians of the cells, in the target's frame [m].
    points : (n, 3) [m]
        Points of the source, in its frame.
    association : str
        Cells that a point is compared with; see `CellAssociation`.
    shape : ScoreShape
    curvature : str
        Exact Hessian, or its convex part.

    Raises
    ------
    InvalidInput
        An unknown association.
    """

    target: VoxelGaussians
    points: Points
    association: CellAssociation = "own-cell"
    shape: ScoreShape = field(default_factory=ScoreShape)
    curvature: Curvature = "exact"

    def __post_init__(self) -> None:
        if self.association not in CELL_ASSOCIATIONS:
            raise InvalidInput(
                f"association must be one of {', '.join(CELL_ASSOCIATIONS)}, "
                f"got {self.association!r}"
            )

    @property
    def count(self) -> int:
        """Number of points of the source."""
        return len(self.points)

    @property
    def positions(self) -> Points:
        """Points of the source."""
        return self.points

    @property
    def is_continuous(self) -> bool:
        """Whether the value does not jump where a point changes its cells."""
        return self.association == "trilinear"

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose`."""
        return Quadratic.from_terms(self._terms(pose, self.points))

    def contributions(self, pose: Pose, blocks: Labels) -> Contributions:
        """Return the contribution of each block of points to gradient and Hessian at `pose`."""
        return contributions_of_rows(blocks, [self.points], partial(self._terms, pose))

    def _terms(self, pose: Pose, points: Points) -> Vector:
        target = self.target
        gaussians = target.gaussians
        grid = target.table, target.cells, target.corner, target.size
        given = points, gaussians.means, gaussians.packed_precisions, *grid
        exact = float(self.curvature == "exact")
        rest = pose.rotation, pose.translation, *self.shape.parameters, exact
        if self.association == "trilinear":
            terms = trilinear_terms(*given, *rest)
        else:
            max_distance = target.size if self.association == "near-cells" else np.inf
            terms = cell_terms(*given, _OFFSETS[self.association], float(max_distance), *rest)
        return self.shape.height / max(1, self.count) * terms
