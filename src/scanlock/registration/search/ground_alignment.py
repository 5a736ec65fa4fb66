"""Height, roll and pitch of a hypothesis from the ground that both scans saw.

Each scan was levelled by its own ground. On a slope, or where the ground rolls, the two grounds
are not one plane: what both saw of it, between the two places, settles how they lie.
"""

import math

import numpy as np

from scanlock.arrays import Matrix, Vector, read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.ground_overlap import ground_gaps, plane_sums
from scanlock.registration.search.bev_grid import BevGrid

_LEAST_CELLS = 12
"""Shared cells that hold three numbers firmly."""

_LEAST_SPREAD = 3.0
"""Standard deviation [m] that shared cells must have along both their axes to tell a tilt."""

_OUTLIER = 0.3
"""A difference in height this far off the fit [m] counts a quarter: a hypothesis is not exact,
and kerbs and banks then lie beside each other."""

_ROUNDS = 6
"""Reweighted least squares; a tilt of 15 degrees takes three."""

_SETTLED = 1e-3
"""A step in height [m] and slope [1] below which the rest is left to the descents."""


def ground_fitted(target: BevGrid, source: BevGrid, pose: Pose) -> Pose:
    """Return a hypothesis with the grounds of both scans laid onto each other.

    Heading and place stay. Where either scan has no ground, or they share too little of it, the
    pose comes back as it was.
    """
    if not (target.has_ground and source.has_ground):
        return pose
    level = target.level_from_scan @ pose @ source.level_from_scan.inverse()
    grids = read_only(target.ground), target.ground_cell, read_only(source.ground)
    for attempt in range(_ROUNDS):
        gaps = ground_gaps(*grids, source.ground_cell, level.rotation, level.translation)
        # All cells count alike until they have been laid onto each other once.
        fit = _plane_through(read_only(gaps), _OUTLIER if attempt > 0 else math.inf)
        if fit is None:
            return pose
        rise, slopes = fit
        turn = exp_rotation(np.array([slopes[1], -slopes[0], 0.0]))
        level = Pose(turn @ level.rotation, level.translation + np.array([0.0, 0.0, rise]))
        if abs(rise) < _SETTLED and np.abs(slopes).max() < _SETTLED:
            break
    return target.level_from_scan.inverse() @ level @ source.level_from_scan


def _plane_through(gaps: Matrix, scale: float) -> tuple[float, Vector] | None:
    """Return the rise of the axis [m] and its (2,) slopes; None where they are not held."""
    (count, x, y, xx, xy, yy), weighted = plane_sums(gaps, scale)
    if count < _LEAST_CELLS:
        return None
    spread = np.array([[xx - x * x / count, xy - x * y / count], [0.0, yy - y * y / count]]) / count
    if np.linalg.eigvalsh(spread, UPLO="U")[0] < _LEAST_SPREAD**2:
        return None
    w, wx, wy, wxx, wxy, wyy = weighted[:6]
    normal = np.array([[w, wx, wy], [wx, wxx, wxy], [wy, wxy, wyy]])
    solved = np.linalg.solve(normal, weighted[6:])
    return float(solved[0]), solved[1:].astype(np.float64, copy=False)
