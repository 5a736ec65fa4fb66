"""Local frames of two scans: their origins in the caller's coordinates."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from scanlock.arrays import Vector, frozen, short_repr
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LocalOrigins:
    """Origins of the local frames of two scans, and the centroid of the source.

    Map coordinates are large, so a rotation about their zero moves points far. Poses are therefore
    computed between local frames whose origins lie within the scans.

    Attributes
    ----------
    target_origin, source_origin : (3,) [m]
        Zero of each local frame in the caller's coordinates: the caller's own zero (the sensor),
        unless the scan lies far from it. Whole metres, so that subtracting them is exact.
    source_centroid : (3,) [m]
        Mean of the source's points, in the caller's coordinates.
    """

    target_origin: Vector
    source_origin: Vector
    source_centroid: Vector

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (self.target_origin, self.source_origin, self.source_centroid):
            frozen(array)

    @classmethod
    def of_sensors(cls) -> "LocalOrigins":
        """Return the origins of scans in their sensors' frames."""
        return cls(
            target_origin=np.zeros(3), source_origin=np.zeros(3), source_centroid=np.zeros(3)
        )

    @classmethod
    def of_clouds(cls, target: PointCloud, source: PointCloud) -> "LocalOrigins":
        """Return the origins of two checked scans."""
        return cls(
            target_origin=target.origin,
            source_origin=source.origin,
            source_centroid=source.centroid,
        )

    @property
    def is_on_map(self) -> bool:
        """Whether the source has map coordinates rather than its sensor's."""
        return bool(self.source_origin.any())

    @property
    def reference_point(self) -> Vector:
        """(3,) the point of the source [m] whose translation is reported.

        The sensor; for a scan in map coordinates the centroid.
        """
        return self.source_centroid if self.is_on_map else self.source_origin

    def local(self, target_from_source: Pose) -> Pose:
        """Convert a pose between the caller's frames to one between the local frames."""
        rotation, translation = target_from_source.rotation, target_from_source.translation
        return Pose(rotation, rotation @ self.source_origin + translation - self.target_origin)

    def caller(self, local: Pose) -> Pose:
        """Convert a pose between the local frames to one between the caller's; see `local`."""
        shift = self.target_origin + local.translation - local.rotation @ self.source_origin
        return Pose(local.rotation, shift)

    def shift(self, target_from_source: Pose, point: Vector) -> Vector:
        """Return the (3,) displacement [m] of a point (3,) of the source under a pose.

        Computed in the local frames, which keeps the digits that map coordinates lose.
        """
        near = point - self.source_origin
        moved = self.local(target_from_source).apply(near)
        return (moved - near) + (self.target_origin - self.source_origin)

    def as_dict(self, target_from_source: Pose) -> dict[str, Any]:
        """Return the origins, and a pose between the local frames, as plain numbers."""
        return {
            "target_origin": self.target_origin.tolist(),
            "source_origin": self.source_origin.tolist(),
            "local_target_from_source": self.local(target_from_source).matrix.tolist(),
            "source_centroid": self.source_centroid.tolist(),
            "centroid_shift_m": self.shift(target_from_source, self.source_centroid).tolist(),
        }

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = (self.target_origin, self.source_origin, self.source_centroid)
        return _rebuilt, tuple(np.array(one) for one in arrays)


def _rebuilt(target_origin: Vector, source_origin: Vector, source_centroid: Vector) -> LocalOrigins:
    return LocalOrigins(
        target_origin=target_origin, source_origin=source_origin, source_centroid=source_centroid
    )
