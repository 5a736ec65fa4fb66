"""What a search for the ground of a scan answers."""

import enum
import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Mask, Vector, frozen


class GroundStatus(enum.Enum):
    """Whether there is a ground to speak of."""

    FOUND = "found"
    """A ground, and the z axis of the cloud is its upward normal to a few degrees."""

    TILTED = "tilted"
    """A ground just as trusted, found after turning the cloud upright: z is not up."""

    NONE = "none"
    """No believable ground; no point is called ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What is ground in a cloud, and where the ground lies.

    Attributes
    ----------
    is_ground : (n,)
        One answer for each row of ``cloud.points``.
    is_below : (n,)
        Points clearly beneath the modelled ground: reflections, or a lower level. Never ground.
    height : (n,) [m]
        Height above the modelled ground; NaN where nothing is modelled.
    status : GroundStatus
        Whether a ground was found.
    reason : str
        One sentence that says why.
    plane : (4,)
        The base plane: ``plane[:3] @ p + plane[3]`` is the height of p above it [m].
        ``plane[3]`` is NaN without ground.
    sensor_height : float [m]
        Height of the origin of the cloud's frame above the base plane; NaN without ground, and
        where the cloud was recentred, so that its origin is no sensor.
    sectors : int
        Sectors with ground of their own, not lent by neighbours.
    """

    is_ground: Mask
    is_below: Mask
    height: Vector
    status: GroundStatus
    reason: str
    plane: Vector
    sensor_height: float
    sectors: int

    def __post_init__(self) -> None:
        for array in (self.is_ground, self.is_below, self.height, self.plane):
            frozen(array)

    @classmethod
    def none(cls, count: int, reason: str) -> "Ground":
        """Return the answer for `count` points none of which is ground."""
        return cls(
            is_ground=np.zeros(count, dtype=np.bool_),
            is_below=np.zeros(count, dtype=np.bool_),
            height=np.full(count, np.nan),
            status=GroundStatus.NONE,
            reason=reason,
            plane=np.array([0.0, 0.0, 1.0, math.nan]),
            sensor_height=math.nan,
            sectors=0,
        )

    @property
    def up(self) -> Vector:
        """(3,) unit normal of the base plane in the frame of the cloud; z without ground."""
        return self.plane[:3]

    @property
    def tilt(self) -> float:
        """Angle between `up` and the z axis [rad]."""
        x, y, z = self.up
        return math.atan2(math.hypot(x, y), z)
