"""Height, roll and pitch of a hypothesis from the ground that both scans saw.

Each scan was levelled by its own ground. On a slope, or where the ground rolls, the two grounds
are not one plane: what both saw of it, between the two places, settles how they lie.
"""

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.plan_view import PlanView

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


def ground_fitted(target: PlanView, source: PlanView, pose: Pose) -> Pose:
    """Return a hypothesis with the grounds of both scans laid onto each other.

    Heading and place stay. Where either scan has no ground, or they share too little of it, the
    pose comes back as it was.
    """
    if not (target.has_ground and source.has_ground):
        return pose
    level = target.level_from_scan @ pose @ source.level_from_scan.inverse()
    ground = _cells_of(source)
    weights = np.ones(len(ground))
    for _ in range(_ROUNDS):
        moved = level.apply(ground)
        rises = _ground_below(target, moved) - moved[:, 2]
        shared = np.isfinite(rises)
        fit = _plane_through(moved[shared], rises[shared], weights[shared], level.translation)
        if fit is None:
            return pose
        rise, slopes = fit
        turn = exp_rotation(np.array([slopes[1], -slopes[0], 0.0]))
        level = Pose(turn @ level.rotation, level.translation + np.array([0.0, 0.0, rise]))
        if abs(rise) < _SETTLED and np.abs(slopes).max() < _SETTLED:
            break
        left = rises - rise - (moved - level.translation)[:, :2] @ slopes
        weights = (1.0 + (np.where(shared, left, 0.0) / _OUTLIER) ** 2) ** -2.0
    return target.level_from_scan.inverse() @ level @ source.level_from_scan


def _cells_of(view: PlanView) -> Points:
    """Return the (g, 3) level points of the ground of a view [m]."""
    known = np.argwhere(np.isfinite(view.ground))
    points = np.empty((len(known), 3))
    points[:, :2] = (known - len(view.ground) // 2 + 0.5) * view.ground_cell
    points[:, 2] = view.ground[known[:, 0], known[:, 1]]
    return points


def _ground_below(view: PlanView, points: Points) -> Vector:
    """Return the level z of the ground at each place, NaN where the view shows none."""
    side = len(view.ground)
    cells = np.floor(points[:, :2] / view.ground_cell).astype(np.int64) + side // 2
    inside = ((cells >= 0) & (cells < side)).all(axis=1)
    heights = np.full(len(points), np.nan)
    heights[inside] = view.ground[cells[inside, 0], cells[inside, 1]]
    return heights


def _plane_through(
    places: Points, rises: Vector, weights: Vector, centre: Vector
) -> tuple[float, Vector] | None:
    """Return the rise at the centre [m] and its (2,) slopes; None where they are not held."""
    if len(rises) < _LEAST_CELLS:
        return None
    level = places[:, :2] - places[:, :2].mean(axis=0)
    if np.linalg.eigvalsh(level.T @ level / len(level))[0] < _LEAST_SPREAD**2:
        return None
    columns = np.column_stack([np.ones(len(rises)), places[:, :2] - centre[:2]])
    weighted = columns * weights[:, None]
    solved = np.linalg.lstsq(weighted.T @ columns, weighted.T @ rises, rcond=None)[0]
    return float(solved[0]), solved[1:].astype(np.float64, copy=False)
