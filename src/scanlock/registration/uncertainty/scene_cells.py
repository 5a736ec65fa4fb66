"""Contributions of the cells of a scene to an objective, and the blocks that the cells form."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Matrix, Points
from scanlock.clouds.voxel_grid import voxel_indices, voxel_labels
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.problem import Separable
from scanlock.registration.uncertainty.sampling_pattern import hessian_along_surfaces
from scanlock.registration.uncertainty.sandwich import BlockTerms


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SceneCells:
    """Contributions of k cells of half a block to the derivatives of an objective at a pose.

    Attributes
    ----------
    gradients : (k, 6)
    hessians : (k, 6, 6)
    centroids : (k, 3) [m]
        Centroids of the elements of the cells, in the target's frame.
    grids : tuple of (k,)
        Block of each cell, in two grids that are half a block apart along all axes, so that the
        covariance depends less on where a grid cuts the scene.
    """

    gradients: Matrix
    hessians: Matrix
    centroids: Points
    grids: tuple[Labels, ...]

    def block_terms(self, free: Labels) -> BlockTerms:
        """Return the terms along some directions of a step."""
        return BlockTerms(
            gradients=self.gradients[:, free],
            hessians=self.hessians[:, free[:, None], free],
            grids=self.grids,
        )

    def hessian_along_surfaces(self) -> Matrix:
        """Return the (6, 6) Hessian without the parts along the normals of the cells."""
        return hessian_along_surfaces(self.hessians, self.centroids)


def scene_cells(
    objective: Separable, pose: Pose, side: float, min_side: float, min_blocks: int
) -> SceneCells | None:
    """Return the cells of the scene at a pose, or None with too few blocks.

    Parameters
    ----------
    objective : Separable
    pose : Pose
        Target from source.
    side, min_side : float [m]
        Side of a block; it is halved down to the minimum while there are too few blocks.
    min_blocks : int
        Minimum number of blocks.
    """
    positions = objective.positions
    while side >= min_side:
        labels, cells = voxel_indices(positions, 0.5 * side)
        terms = objective.contributions(pose, labels)
        filled = np.flatnonzero(terms.hessians.any(axis=(1, 2)))
        if len(filled):
            corners = cells[filled].astype(np.float64)
            grids = tuple(voxel_labels(corners + shift, 2.0)[0] for shift in (0.5, 1.5))
            if min(int(grid.max()) + 1 for grid in grids) >= min_blocks:
                return SceneCells(
                    gradients=terms.gradients[filled],
                    hessians=terms.hessians[filled],
                    centroids=pose.apply(_centroids(positions, labels)[filled]),
                    grids=grids,
                )
        side *= 0.5
    return None


def _centroids(positions: Points, labels: Labels) -> Points:
    """Return the mean position of each label."""
    sums = [np.bincount(labels, positions[:, axis]) for axis in range(3)]
    return np.column_stack(sums) / np.bincount(labels)[:, None]
