"""Which parts of a site are taken, so that no two things stand in one place."""

from collections.abc import Callable

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.objects.mover import level_frame

_CELL = 0.5
"""Side of a cell of the site [m]."""

_WHEELBASE = 2.7
"""Distance between the axles of a parked car [m]."""


class Site:
    """A raster of free and taken ground; things claim the rectangle that they stand on.

    Attributes
    ----------
    low, high : (2,) [m]
        Corners of the site.
    """

    def __init__(self, low: Vector, high: Vector) -> None:
        self.low = np.asarray(low, np.float64)
        self.high = np.asarray(high, np.float64)
        shape = np.ceil((self.high - self.low) / _CELL).astype(int) + 1
        self._taken = np.zeros(tuple(shape), np.bool_)

    def cells(self) -> Matrix:
        """Return the middle of every cell, (n, 2) [m]."""
        i, j = np.indices(self._taken.shape)
        return self.low + _CELL * np.column_stack([i.ravel(), j.ravel()])

    def block(self, cells: np.ndarray) -> None:
        """Take the cells of a mask (n,) in the order of `cells`."""
        self._taken |= cells.reshape(self._taken.shape)

    def claim(
        self,
        middle: Vector,
        yaw: float,
        length: float,
        width: float,
        margin: float = 0.0,
    ) -> bool:
        """Take a rectangle if it and a margin [m] around it are free, and say whether it was."""
        index = self._index(middle, yaw, length + 2 * margin, width + 2 * margin)
        shape = np.array(self._taken.shape)
        if (index < 0).any() or (index >= shape).any() or self._taken[tuple(index.T)].any():
            return False
        inner = self._index(middle, yaw, length, width)
        self._taken[tuple(inner.T)] = True
        return True

    def _index(self, middle: Vector, yaw: float, length: float, width: float) -> np.ndarray:
        counts = [max(int(np.ceil(side / (0.7 * _CELL))), 1) + 1 for side in (length, width)]
        x, y = np.meshgrid(
            np.linspace(-0.5 * length, 0.5 * length, counts[0]),
            np.linspace(-0.5 * width, 0.5 * width, counts[1]),
        )
        cos, sin = np.cos(yaw), np.sin(yaw)
        places = np.column_stack(
            [
                middle[0] + cos * x.ravel() - sin * y.ravel(),
                middle[1] + sin * x.ravel() + cos * y.ravel(),
            ]
        )
        return np.rint((places - self.low) / _CELL).astype(int)


def parked(level: Callable[[Matrix], Vector], place: Vector, yaw: float) -> Pose:
    """Return world_from_object of a car at a (2,) place, with both axles on the ground.

    `level` gives the height of the ground (n,) at (n, 2) places.
    """
    half = 0.5 * _WHEELBASE * np.array([np.cos(yaw), np.sin(yaw)])
    axles = np.array([place - half, place + half])
    rear, front = np.column_stack([axles, level(axles)])
    ahead = (front - rear) / np.linalg.norm(front - rear)
    return Pose(level_frame(ahead), 0.5 * (front + rear))


def standing(place: Vector, yaw: float) -> Pose:
    """Return world_from_object of something upright at a (3,) place, turned by `yaw` [rad]."""
    return Pose(exp_rotation(np.array([0.0, 0.0, yaw])), np.asarray(place, np.float64))
