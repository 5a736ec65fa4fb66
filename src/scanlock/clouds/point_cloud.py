"""Validated point clouds: shape, type, finiteness and precision are checked once, here."""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Mask, Points, Vector, frozen, read_only
from scanlock.clouds.coordinates import HasPoints, coordinates_of
from scanlock.clouds.memory import keep_freed_memory
from scanlock.errors import InvalidInput

_MAX_LOCAL = 120.0
"""Median coordinate [m] beyond which points are recentred.

Such coordinates are those of a map, since a sensor frame is centred on the scan. No polar grid
about the origin reaches them, and millions of metres cost digits in every product.
"""

_MAX_COORDINATE = 1e12
"""Largest valid coordinate [m]; larger ones count as not finite.

Map projections stay below 1e8 m, or 1e11 in millimetres. Grid indices of much larger coordinates
would overflow silently.
"""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Finite points in local coordinates, with their input rows and the origin of their frame.

    Build with `PointCloud.from_array`; the constructor checks nothing.

    Attributes
    ----------
    points : (n, 3) [m]
        Read-only, C-contiguous float64 points; ``scale * points + origin`` are the input
        coordinates.
    origin : (3,) [m]
        Origin of the local frame in input coordinates: zero for sensor frames, whole metres near
        the median of the points for map coordinates.
    rows : (n,)
        Row of the input array of each point.
    input_count : int
        Number of rows of the input array.
    rounding : float [m]
        Estimated rounding of map coordinates: 0.5 m for single precision at 5000 km. Zero for
        sensor frames.
    scale : float
        Length of a unit of `points` [m]: 1, and more for a sparse cloud from `scaled`.
    """

    points: Points
    origin: Vector
    rows: Labels
    input_count: int
    rounding: float = 0.0
    scale: float = 1.0

    def __post_init__(self) -> None:
        for array in (self.points, self.origin, self.rows):
            frozen(array)

    @classmethod
    def from_array(
        cls, array: "ArrayLike | HasPoints | PointCloud", name: str = "points"
    ) -> "PointCloud":
        """Build a cloud from an array of points.

        Rows with NaN, Inf, masked entries or coordinates beyond 1e12 m are dropped and counted.

        Parameters
        ----------
        array : (n, 3+) array, object with one as its attribute ``points``, or PointCloud [m]
            Points, for example of an Open3D cloud; columns past the third are ignored. A
            C-contiguous (n, 3) float64 array is not copied: do not write to it while the cloud is
            in use. A cloud is returned unchanged.
        name : str
            Name of the argument in error messages.

        Raises
        ------
        InvalidInput
            Not a real-valued (n, 3+) array, or no finite row.
        """
        if isinstance(array, PointCloud):
            return array
        _keep_freed_memory_once()
        xyz = coordinates_of(array, name)
        input_count = len(xyz)
        rows = _finite_rows(xyz)
        if len(rows) < input_count:
            xyz = xyz[rows]
        if len(xyz) == 0:
            raise InvalidInput(
                f"{name} has no finite point ({input_count} rows); check the reader or filter "
                "that produced it"
            )
        origin, rounding = _recentring(xyz), 0.0
        if origin.any():
            rounding = _rounding(xyz)
            xyz = xyz - origin
        return cls(xyz, origin, rows, input_count, rounding)

    @property
    def dropped_count(self) -> int:
        """Number of rows of the input array without finite, valid coordinates."""
        return self.input_count - len(self.points)

    @property
    def radius(self) -> float:
        """Median distance of the points from their median, in the maximum norm [m]."""
        sample = _sample(self.points)
        distances = np.abs(sample - np.median(sample, axis=0)).max(axis=1)
        return self.scale * float(np.median(distances))

    @cached_property
    def centroid(self) -> Vector:
        """(3,) mean of the points in input coordinates [m]."""
        # By column: NumPy is twenty times slower for a mean over rows of three numbers.
        mean = np.array([self.points[:, axis].mean() for axis in range(3)])
        return read_only(self.scale * mean + self.origin)

    @cached_property
    def measured_points(self) -> Points:
        """The (m, 3) points that are measurements; see `is_measured`."""
        from scanlock.kernels.points.rows import selected_points

        if self.is_measured.all():
            return self.points
        return read_only(selected_points(self.points, self.is_measured))

    @cached_property
    def is_sparse(self) -> bool:
        """Whether small cubes have too few points for a Gaussian, in the units of `points`."""
        from scanlock.clouds.length_scale import is_sparse

        return is_sparse(self.measured_points)

    @property
    def takes_sparse_settings(self) -> bool:
        """Whether settings for sparse clouds apply: the cloud is sparse, or the other of a pair."""
        return self.scale > 1.0 or self.is_sparse

    @cached_property
    def length_scale(self) -> float:
        """Factor of the lengths of all settings for this cloud: 1, and more if it is sparse."""
        from scanlock.clouds.length_scale import length_scale_of

        return self.scale * length_scale_of(self.measured_points) if self.is_sparse else self.scale

    @cached_property
    def is_measured(self) -> Mask:
        """(n,) whether each point is a measurement; False at the origin of a sensor frame.

        Drivers write (0, 0, 0) for beams without a return.
        """
        # Imported here, so that reading scans does not load the compiler.
        from scanlock.kernels.points.rows import is_nonzero

        if self.origin.any():
            return read_only(np.ones(len(self.points), np.bool_))
        return read_only(is_nonzero(self.points))

    def __len__(self) -> int:
        return len(self.points)

    def scaled(self, scale: float) -> "PointCloud":
        """Return the cloud with coordinates in units of `scale` metres."""
        if scale == self.scale:
            return self
        return replace(self, points=read_only(self.points * (self.scale / scale)), scale=scale)

    def to_input_rows(self, values: Labels, fill: int = -1) -> Labels:
        """Return (n,) values as one for each row of the input array; `fill` for dropped rows."""
        full = np.full(self.input_count, fill, dtype=np.int64)
        full[self.rows] = values
        return full

    def __repr__(self) -> str:
        about = f" about {self.origin.tolist()}" if self.origin.any() else ""
        return f"PointCloud({len(self):,} points{about})"

    def __reduce__(self) -> tuple[Any, ...]:
        return PointCloud, (
            np.array(self.points),
            np.array(self.origin),
            np.array(self.rows),
            self.input_count,
            self.rounding,
            self.scale,
        )


@cache
def _keep_freed_memory_once() -> None:
    keep_freed_memory()


def _finite_rows(xyz: Points) -> Labels:
    # The extremes need no mask of all coordinates; a mask only if one is too large or NaN.
    flat = xyz.ravel()
    if flat.max(initial=0.0) <= _MAX_COORDINATE and flat.min(initial=0.0) >= -_MAX_COORDINATE:
        return np.arange(len(xyz), dtype=np.int64)
    return np.flatnonzero((np.abs(xyz) <= _MAX_COORDINATE).all(axis=1)).astype(np.int64)


def _sample(xyz: Points) -> Points:
    """Return a few hundred rows, for estimates of the position and size of a cloud."""
    return xyz[:: max(1, len(xyz) // 512)]


def _rounding(xyz: Points) -> float:
    sample = _sample(xyz)
    # Single precision may have been converted to double before.
    if not np.array_equal(sample, sample.astype(np.float32)):
        return float(np.spacing(np.abs(sample).max()))
    return float(np.spacing(np.float32(np.abs(sample).max())))


def _recentring(xyz: Points) -> Vector:
    # Whole metres keep the shift exact.
    centre = np.median(_sample(xyz), axis=0)
    if np.abs(centre).max() < _MAX_LOCAL:
        return np.zeros(3)
    return np.round(centre)
