"""Result of ground segmentation."""

import enum
import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Mask, Vector, frozen, short_repr


class GroundStatus(enum.Enum):
    """Outcome of ground segmentation."""

    FOUND = "found"
    """Ground whose upward normal is the z axis of the cloud to within a few degrees."""

    TILTED = "tilted"
    """Ground of a tilted sensor, found after levelling the cloud: the z axis is not up."""

    NONE = "none"
    """No reliable ground; no point is labelled as ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """Ground points of a cloud, and the model of the ground.

    Attributes
    ----------
    is_ground : (n,)
        Whether each row of ``cloud.points`` is ground.
    is_below : (n,)
        Whether each point is clearly below the modelled ground: reflections, or a lower level.
        Such points are not ground.
    height : (n,) [m]
        Height above the modelled ground; NaN without a model.
    status : GroundStatus
        Outcome.
    reason : str
        Reason for the status, one sentence.
    plane : (4,)
        Base plane: ``plane[:3] @ p + plane[3]`` is the height of p above it [m]. ``plane[3]`` is
        NaN without ground.
    sensor_height : float [m]
        Height of the origin of the cloud above the base plane. NaN without ground, and for
        recentred clouds, whose origin is not the sensor.
    sectors : int
        Number of sectors with ground prototypes of their own, without interpolated ones.
    """

    is_ground: Mask
    is_below: Mask
    height: Vector
    status: GroundStatus
    reason: str
    plane: Vector
    sensor_height: float
    sectors: int

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (self.is_ground, self.is_below, self.height, self.plane):
            frozen(array)

    @classmethod
    def none(cls, count: int, reason: str) -> "Ground":
        """Return the result of a cloud of `count` points without ground."""
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
