"""Moving objects: their pose and velocity over time."""

from dataclasses import dataclass, field

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.errors import InvalidInput, require_at_least
from scanlock.geometry.pose import Pose
from scanlock.simulation.objects.surfaces import Surfaces


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Mover:
    """A rigid object that follows a path at constant speed, with its x axis ahead.

    Attributes
    ----------
    surfaces : Surfaces [m]
        Surfaces in the frame of the object: x ahead, y to the left, with the origin on the path.
    path : (k, 3) [m]
        Corners of the path in the world. A path whose last corner equals its first is closed and
        is repeated; on other paths the object stops at the end.
    start : float [m]
        Arc length at time 0.
    speed : float [m/s]
        Speed along the path, not negative.
    radius : float [m]
        Maximum distance of a surface from the origin of the object.

    Raises
    ------
    InvalidInput
        A path of fewer than two different corners, or a negative speed.
    """

    surfaces: Surfaces
    path: Points
    start: float
    speed: float
    radius: float = field(init=False)
    _ends: Vector = field(init=False)

    def __post_init__(self) -> None:
        require_at_least("speed", self.speed, 0.0, unit="m/s")
        path = np.array(self.path, np.float64)
        if path.ndim != 2 or path.shape[1] != 3 or len(path) < 2:
            raise InvalidInput(f"path must have shape (k, 3) with k > 1, got {path.shape}")
        if not (np.isfinite(path).all() and (np.diff(path, axis=0) != 0).any(axis=1).all()):
            raise InvalidInput("path must be finite, and consecutive corners must differ")
        ends = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
        bounds = np.abs(self.surfaces.bounds())
        farthest = np.maximum(bounds[:, :3], bounds[:, 3:])
        object.__setattr__(self, "radius", float(np.linalg.norm(farthest, axis=1).max(initial=0)))
        for name, array in (("path", path), ("_ends", ends)):
            frozen(array)
            object.__setattr__(self, name, array)

    def at(self, time: float) -> tuple[Pose, Vector]:
        """Return ``world_from_object`` and the velocity [m/s] in the world at a time [s]."""
        total = float(self._ends[-1])
        along = self.start + self.speed * time
        is_moving = True
        if np.array_equal(self.path[0], self.path[-1]):
            along = along % total
        else:
            is_moving = 0.0 <= along < total
            along = min(max(along, 0.0), total)
        k = int(np.searchsorted(self._ends, along, side="right")) - 1
        k = min(k, len(self.path) - 2)
        ahead = (self.path[k + 1] - self.path[k]) / (self._ends[k + 1] - self._ends[k])
        position = self.path[k] + (along - self._ends[k]) * ahead
        velocity = self.speed * ahead if is_moving else np.zeros(3)
        return Pose(level_frame(ahead), position), velocity


def level_frame(ahead: Vector) -> Matrix:
    """Return the (3, 3) rotation with x along the unit vector `ahead` and y horizontal."""
    norm = np.hypot(ahead[0], ahead[1])
    left = np.array([-ahead[1], ahead[0], 0.0]) / norm if norm > 0 else np.array([0.0, 1.0, 0.0])
    return np.column_stack([ahead, left, np.cross(ahead, left)])
