"""The frames of two registered scans: the caller's, and the local ones that it was computed in."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.arrays import Vector, frozen
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose


@dataclass(frozen=True, slots=True, eq=False)
class LocalOrigins:
    """Where the local frames of two scans lie in the caller's, and where the source is.

    Coordinates of a map are large, and a turn about their zero is a long way: they are computed
    about an origin amid each scan, and motions are told where the source is.

    Attributes
    ----------
    target_origin, source_origin : (3,) [m]
        Zero of each local frame in the caller's coordinates: the caller's own zero, the sensor,
        unless the scan lies far from it. Whole metres, so that shifting by it loses nothing.
    source_centroid : (3,) [m]
        Mean of the source's points, in the caller's coordinates.
    """

    target_origin: Vector
    source_origin: Vector
    source_centroid: Vector

    def __post_init__(self) -> None:
        for array in (self.target_origin, self.source_origin, self.source_centroid):
            frozen(array)

    @classmethod
    def of_sensors(cls) -> "LocalOrigins":
        """Return those of scans in their sensors' frames of which nothing more is known."""
        return cls(np.zeros(3), np.zeros(3), np.zeros(3))

    @classmethod
    def of_clouds(cls, target: PointCloud, source: PointCloud) -> "LocalOrigins":
        """Return those of two scans."""
        return cls(target.origin, source.origin, source.centroid)

    @property
    def is_on_map(self) -> bool:
        """Whether the source came in coordinates of a map, and is no sensor's view."""
        return bool(self.source_origin.any())

    @property
    def place(self) -> Vector:
        """(3,) the point of the source [m] whose motion is worth telling.

        Its sensor; of a scan in map coordinates its centroid.
        """
        return self.source_centroid if self.is_on_map else self.source_origin

    def local(self, target_from_source: Pose) -> Pose:
        """Return a pose between the caller's frames as one between the local frames."""
        rotation, translation = target_from_source.rotation, target_from_source.translation
        return Pose(rotation, rotation @ self.source_origin + translation - self.target_origin)

    def caller(self, local: Pose) -> Pose:
        """Return a pose between the local frames as one between the caller's; see `local`."""
        shift = self.target_origin + local.translation - local.rotation @ self.source_origin
        return Pose(local.rotation, shift)

    def shift(self, target_from_source: Pose, place: Vector) -> Vector:
        """Return (3,) how far a pose moves a point (3,) of the source [m].

        By way of the local frames, which keeps the digits that map coordinates would take.
        """
        near = place - self.source_origin
        landed = self.local(target_from_source).apply(near)
        return (landed - near) + (self.target_origin - self.source_origin)

    def as_dict(self, target_from_source: Pose) -> dict[str, Any]:
        """Return the frames, and a pose as it is between the local ones, as plain numbers."""
        return {
            "target_origin": self.target_origin.tolist(),
            "source_origin": self.source_origin.tolist(),
            "local_target_from_source": self.local(target_from_source).matrix.tolist(),
            "source_centroid": self.source_centroid.tolist(),
            "centroid_shift_m": self.shift(target_from_source, self.source_centroid).tolist(),
        }

    def __reduce__(self) -> tuple[Any, ...]:
        return LocalOrigins, tuple(
            np.array(one) for one in (self.target_origin, self.source_origin, self.source_centroid)
        )
