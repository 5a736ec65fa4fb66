"""Occupancy grid of a site, so that objects do not overlap, and poses of objects on the ground."""

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
    """An occupancy grid in which objects claim their rectangular footprints.

    Attributes
    ----------
    low, high : (2,) [m]
        Corners of the site.
    """

    def __init__(self, low: Vector, high: Vector) -> None:
        self.low = np.asarray(low, np.float64)
        self.high = np.asarray(high, np.float64)
        shape = np.ceil((self.high - self.low) / _CELL).astype(int) + 1
        self._occupied = np.zeros(tuple(shape), np.bool_)

    def cells(self) -> Matrix:
        """Return the (n, 2) centres of all cells [m]."""
        i, j = np.indices(self._occupied.shape)
        return self.low + _CELL * np.column_stack([i.ravel(), j.ravel()])

    def block(self, cells: np.ndarray) -> None:
        """Occupy the cells of a mask (n,) in the order of `cells`."""
        self._occupied |= cells.reshape(self._occupied.shape)

    def claim(
        self,
        middle: Vector,
        yaw: float,
        length: float,
        width: float,
        margin: float = 0.0,
    ) -> bool:
        """Occupy a rectangle if it and a margin around it are free; return whether it was free.

        Parameters
        ----------
        middle : (2,) [m]
        yaw : float [rad]
        length, width, margin : float [m]
        """
        index = self._index(middle, yaw, length + 2 * margin, width + 2 * margin)
        shape = np.array(self._occupied.shape)
        if (index < 0).any() or (index >= shape).any() or self._occupied[tuple(index.T)].any():
            return False
        inner = self._index(middle, yaw, length, width)
        self._occupied[tuple(inner.T)] = True
        return True

    def _index(self, middle: Vector, yaw: float, length: float, width: float) -> np.ndarray:
        counts = [max(int(np.ceil(side / (0.7 * _CELL))), 1) + 1 for side in (length, width)]
        x, y = np.meshgrid(
            np.linspace(-0.5 * length, 0.5 * length, counts[0]),
            np.linspace(-0.5 * width, 0.5 * width, counts[1]),
        )
        cos, sin = np.cos(yaw), np.sin(yaw)
        positions = np.column_stack(
            [
                middle[0] + cos * x.ravel() - sin * y.ravel(),
                middle[1] + sin * x.ravel() + cos * y.ravel(),
            ]
        )
        return np.rint((positions - self.low) / _CELL).astype(int)


def car_pose(height: Callable[[Matrix], Vector], position: Vector, yaw: float) -> Pose:
    """Return ``world_from_object`` of a car with both axles on the ground.

    Parameters
    ----------
    height : callable
        Function that returns the (n,) heights of the ground at (n, 2) positions [m].
    position : (2,) [m]
    yaw : float [rad]
    """
    half = 0.5 * _WHEELBASE * np.array([np.cos(yaw), np.sin(yaw)])
    axles = np.array([position - half, position + half])
    rear, front = np.column_stack([axles, height(axles)])
    ahead = (front - rear) / np.linalg.norm(front - rear)
    return Pose(level_frame(ahead), 0.5 * (front + rear))


def upright_pose(position: Vector, yaw: float) -> Pose:
    """Return ``world_from_object`` of an upright object at a (3,) position and a yaw [rad]."""
    return Pose(exp_rotation(np.array([0.0, 0.0, yaw])), np.asarray(position, np.float64))
