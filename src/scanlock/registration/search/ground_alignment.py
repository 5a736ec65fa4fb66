"""Ground alignment: height, roll and pitch of a hypothesis from the ground of both scans.

Each scan is levelled by its own ground. On slopes and rolling ground the two levelled frames
differ. A robust fit of a plane to the height differences over the shared ground corrects that.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.ground_overlap import ground_differences, plane_sums
from scanlock.registration.search.bev_grid import BevGrid

_MIN_CELLS = 12
"""Minimum number of shared ground cells for a plane with three parameters."""

_MIN_DEVIATION = 3.0
"""Minimum standard deviation of the shared cells along either principal axis [m]; a narrower
overlap does not constrain roll and pitch."""

_RESIDUAL_SCALE = 0.3
"""Residual with a weight of a quarter [m]. A hypothesis is inexact: at kerbs and banks it compares
different ground."""

_MAX_ITERATIONS = 6
"""Maximum number of reweighted least-squares steps; 15 degrees of roll and pitch take three."""

_STEP_TOLERANCE = 1e-3
"""Step in height [m] and slope [1] at convergence; the refinement does the rest."""


def align_grounds(target: BevGrid, source: BevGrid, pose: Pose) -> Pose:
    """Correct height, roll and pitch of a hypothesis by the ground that both scans observed.

    Heading and horizontal translation stay. The pose is returned unchanged if a scan has no
    ground, or if the shared ground is too small.
    """
    if not (target.has_ground and source.has_ground):
        return pose
    level = target.level_from_scan @ pose @ source.level_from_scan.inverse()
    target_ground, source_ground = (read_only(grid.ground_heights) for grid in (target, source))
    for iteration in range(_MAX_ITERATIONS):
        differences = ground_differences(
            target_ground,
            target.ground_cell_size,
            source_ground,
            source.ground_cell_size,
            level.rotation,
            level.translation,
        )
        # The first step is not robust: at first all differences may exceed the scale.
        scale = _RESIDUAL_SCALE if iteration > 0 else math.inf
        plane = _fit_plane(read_only(differences), scale)
        if plane is None:
            return pose
        height, slopes = plane
        rotation = exp_rotation(np.array([slopes[1], -slopes[0], 0.0]))
        level = Pose(rotation @ level.rotation, level.translation + np.array([0.0, 0.0, height]))
        if abs(height) < _STEP_TOLERANCE and np.abs(slopes).max() < _STEP_TOLERANCE:
            break
    return target.level_from_scan.inverse() @ level @ source.level_from_scan


def _fit_plane(differences: Matrix, scale: float) -> tuple[float, Vector] | None:
    """Fit a plane to the height differences of `ground_differences`.

    Returns its height at the axis [m] and its (2,) slopes; None if they are not constrained.
    """
    (count, x, y, xx, xy, yy), weighted = plane_sums(differences, scale)
    if count < _MIN_CELLS:
        return None
    covariance = (
        np.array([[xx - x * x / count, xy - x * y / count], [0.0, yy - y * y / count]]) / count
    )
    if np.linalg.eigvalsh(covariance, UPLO="U")[0] < _MIN_DEVIATION**2:
        return None
    w, wx, wy, wxx, wxy, wyy = weighted[:6]
    normal = np.array([[w, wx, wy], [wx, wxx, wxy], [wy, wxy, wyy]])
    solved = np.linalg.solve(normal, weighted[6:])
    return float(solved[0]), solved[1:].astype(np.float64, copy=False)
