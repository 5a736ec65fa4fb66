"""The one gate that points pass: shape, finiteness, type and precision are settled here."""

import os
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels, Mask, Points, Vector, frozen, read_only
from scanlock.clouds.memory import keep_freed_memory
from scanlock.errors import InvalidInput

# Here, since whatever works on scans has passed this gate.
keep_freed_memory()

_LOCAL_LIMIT = 120.0
"""Median distance from zero [m] beyond which coordinates are recentred.

The points of a sensor's frame lie around it, so these coordinates are of a map: no polar grid
about zero reaches them, and millions of metres would cost digits in every product.
"""

_FARTHEST = 1e12
"""Coordinates beyond this [m] are no places but garbage, and count as not finite.

Map projections stay below 1e8 m, 1e11 when written in millimetres; grids laid over 1e300 m
would overflow their integers without a word.
"""

_FEW_ROWS, _MANY_COLUMNS = 4, 64
"""An array so low and so wide holds points in its columns."""


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Finite points in local coordinates, with the way back to the caller's rows and frame.

    Build one with `PointCloud.from_array`; the constructor expects checked parts.

    Attributes
    ----------
    points : (n, 3) [m]
        C-contiguous float64 and read-only; ``points + origin`` are the caller's coordinates.
    origin : (3,) [m]
        Zero for sensor frames; whole metres amid the cloud for map-projection coordinates.
    rows : (n,)
        The row of the caller's array that each point came from.
    input_count : int
        Rows of the caller's array; ``input_count - len(points)`` of them were left out.
    rounding : float [m]
        What the caller's coordinates were rounded to before they came here, where that can be
        told: half a metre for single precision at five million metres. 0 for sensor frames.
    """

    points: Points
    origin: Vector
    rows: Labels
    input_count: int
    rounding: float = 0.0

    def __post_init__(self) -> None:
        for array in (self.points, self.origin, self.rows):
            frozen(array)

    @classmethod
    def from_array(cls, array: "ArrayLike | PointCloud", name: str = "points") -> "PointCloud":
        """Return the cloud of an (n, 3+) array; columns past the third are ignored.

        Rows with NaN, Inf, masked entries or more than 1e12 m in their coordinates are left out
        and counted.
        The array is copied if and only if it is not already C-contiguous (n, 3) float64, and
        never written to; while the cloud is in use, do not write to it either.

        Raises
        ------
        InvalidInput
            Not a real-valued (n, 3+) array, or no finite row in it; `name` says which argument.
        """
        if isinstance(array, PointCloud):
            return array
        xyz = _coordinates(array, name)
        input_count = len(xyz)
        rows = _finite_rows(xyz)
        if len(rows) < input_count:
            xyz = xyz[rows]
        if len(xyz) == 0:
            raise InvalidInput(
                f"{name} holds no finite point ({input_count} rows); check the reader or the "
                "filter before it"
            )
        origin, rounding = _recentring(xyz), 0.0
        if origin.any():
            rounding = _rounding(xyz)
            xyz = xyz - origin
        return cls(xyz, origin, rows, input_count, rounding)

    @property
    def dropped_count(self) -> int:
        """How many rows of the caller's array held NaN, Inf or garbage."""
        return self.input_count - len(self.points)

    @property
    def spread(self) -> float:
        """How far half of the points lie from amid them, at least [m]."""
        sample = _sample(self.points)
        return float(np.median(np.abs(sample - np.median(sample, axis=0)).max(axis=1)))

    @cached_property
    def centroid(self) -> Vector:
        """(3,) mean of the points in the caller's coordinates [m]."""
        # Column by column: NumPy takes a mean over rows of three numbers at a twentieth the speed.
        return read_only(np.array([self.points[:, axis].mean() for axis in range(3)]) + self.origin)

    @cached_property
    def is_measured(self) -> Mask:
        """(n,) False for points at exactly (0, 0, 0) of a sensor's frame.

        Such a point is no place but a driver's word for "no return".
        """
        # Here, so that who only reads scans does not load a compiler.
        from scanlock.kernels.points.rows import is_off_zero

        if self.origin.any():
            return read_only(np.ones(len(self.points), np.bool_))
        return read_only(is_off_zero(self.points))

    def __len__(self) -> int:
        return len(self.points)

    def to_input_rows(self, values: Labels, fill: int = -1) -> Labels:
        """Return one value for each row of the caller's array; `fill` for rows left out."""
        full = np.full(self.input_count, fill, dtype=np.int64)
        full[self.rows] = values
        return full

    def __reduce__(self) -> tuple[Any, ...]:
        return PointCloud, (
            np.array(self.points),
            np.array(self.origin),
            np.array(self.rows),
            self.input_count,
            self.rounding,
        )


def _coordinates(array: ArrayLike, name: str) -> Points:
    if isinstance(array, (str, bytes, os.PathLike, type(None))):
        raise InvalidInput(
            f"{name} must be an (n, 3) array, got {array!r}; scanlock.io.read_scan reads files"
        )
    if isinstance(array, np.ma.MaskedArray) and array.dtype.kind in "fiu":
        # What is masked is no number, and whoever masked it does not want it used.
        kind = np.promote_types(array.dtype, np.float32)
        array = np.ma.filled(array.astype(kind), np.nan)
    try:
        raw = np.asarray(array)
    except ValueError as error:
        raise InvalidInput(f"{name} must be an (n, 3) array: {error}") from error
    if raw.dtype.names is not None:
        raise InvalidInput(
            f"{name} must be an (n, 3) array, got the fields {', '.join(raw.dtype.names)}; stack "
            "its coordinates: np.column_stack([a['x'], a['y'], a['z']])"
        )
    if raw.ndim != 2 or raw.shape[1] < 3:
        raise InvalidInput(f"{name} must have shape (n, 3) or wider, got {raw.shape}")
    if len(raw) <= _FEW_ROWS and raw.shape[1] >= _MANY_COLUMNS:
        raise InvalidInput(
            f"{name} must hold one point a row, got shape {raw.shape}; transpose it: {name}.T"
        )
    if raw.dtype.kind not in "fiu":
        remedy = "; convert it: .astype(np.float64)" if raw.dtype.kind == "O" else ""
        raise InvalidInput(f"{name} must hold real numbers, got dtype {raw.dtype}{remedy}")
    # Extended precision may hold more than float64 can; Inf is what such rows should become.
    with np.errstate(over="ignore"):
        # The slice is an array of its own, so freezing it leaves the caller's writable. Kernels
        # are compiled for aligned memory, which a view into a file's bytes may not be.
        xyz = raw[:, :3]
        if xyz.dtype == np.float64 and xyz.flags.c_contiguous and xyz.flags.aligned:
            return xyz
        # Column by column: NumPy converts rows of three numbers at half the speed.
        converted = np.empty(xyz.shape, np.float64)
        for axis in range(3):
            converted[:, axis] = xyz[:, axis]
        return converted


def _finite_rows(xyz: Points) -> Labels:
    # The extremes need no mask of all coordinates; where one is too large, or both are NaN, the
    # rows are looked at one by one.
    flat = xyz.ravel()
    if flat.max(initial=0.0) <= _FARTHEST and flat.min(initial=0.0) >= -_FARTHEST:
        return np.arange(len(xyz), dtype=np.int64)
    return np.flatnonzero((np.abs(xyz) <= _FARTHEST).all(axis=1)).astype(np.int64)


def _sample(xyz: Points) -> Points:
    """Return a few hundred rows, which tell where a cloud lies."""
    return xyz[:: max(1, len(xyz) // 512)]


def _rounding(xyz: Points) -> float:
    sample = _sample(xyz)
    # Whoever converts to double precision late has lost the digits all the same.
    if not np.array_equal(sample, sample.astype(np.float32)):
        return float(np.spacing(np.abs(sample).max()))
    return float(np.spacing(np.float32(np.abs(sample).max())))


def _recentring(xyz: Points) -> Vector:
    # Whole metres keep the shift exact.
    centre = np.median(_sample(xyz), axis=0)
    if np.abs(centre).max() < _LOCAL_LIMIT:
        return np.zeros(3)
    return np.round(centre)
