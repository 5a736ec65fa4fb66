"""Coordinates of arrays, tables and point clouds of other libraries, without importing these."""

import os
from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Points
from scanlock.errors import InvalidInput

_MAX_TRANSPOSED_ROWS, _MIN_TRANSPOSED_COLUMNS = 4, 64
"""Maximum rows and minimum columns of an array that has a point in each column."""

_AXES = ("x", "y", "z")

_ATTRIBUTES = ("xyz", "points", "vertices")
"""Attributes with the points of an object, in order of preference.

``xyz`` of laspy, whose ``points`` are raw records; ``points`` of Open3D, PyVista and `ScanFile`;
``vertices`` of trimesh.
"""


class HasPoints(Protocol):
    """Point cloud of another library, such as Open3D."""

    @property
    def points(self) -> Any:
        """(n, 3) points [m], convertible by ``numpy.asarray``."""
        ...


def coordinates_of(scan: ArrayLike | HasPoints, name: str) -> Points:
    """Return the (n, 3) float64 coordinates of a scan, C-contiguous and aligned.

    Parameters
    ----------
    scan : array, table or object [m]
        An (n, 3+) array; a structured array, mapping, DataFrame or object with x, y and z; or an
        object with such points, see `_ATTRIBUTES`. A float64 array is not copied.
    name : str
        Name of the argument in error messages.

    Raises
    ------
    InvalidInput
        Anything else, complex or text values, one point per column, columns without x, y and z,
        or coordinates in degrees.
    """
    if isinstance(scan, (str, bytes, os.PathLike, type(None))):
        raise InvalidInput(
            f"{name} must be an (n, 3) array, got {scan!r}; scanlock.read_scan reads files"
        )
    _require_projected(scan, name)
    table = _columns(scan, name)
    if table is not None:
        return _filled(table, len(table[0]))
    array, name = _points_of(scan, name)
    raw = _as_array(array, name)
    if raw.dtype.names is not None:
        table = _named(raw, raw.dtype.names, name)
        return _filled(table, len(raw))
    return _checked(raw, array, name)


def _require_projected(scan: Any, name: str) -> None:
    """Raise unless the coordinate system of a scan, if it has one, has lengths as coordinates."""
    crs = getattr(scan, "crs", None)
    if getattr(crs, "is_geographic", False) is True:
        system = getattr(crs, "name", crs)
        raise InvalidInput(
            f"{name} has longitudes and latitudes in degrees ({system}); project it to a map in "
            "metres first, for example with pdal or pyproj"
        )


def _columns(scan: Any, name: str) -> list[NDArray[Any]] | None:
    """Return x, y and z of a table by the names of its columns; None for anything else."""
    if isinstance(scan, np.ndarray):
        return None
    if isinstance(scan, Mapping):
        return _named(scan, list(scan), name)
    if all(hasattr(scan, axis) for axis in _AXES):
        return _named({axis: getattr(scan, axis) for axis in _AXES}, _AXES, name)
    names = getattr(scan, "column_names", None) or getattr(scan, "columns", None)
    if names is None or not hasattr(scan, "__getitem__"):
        return None
    names = list(names)
    # Unnamed columns are numbered by pandas, and taken by position as those of an array.
    if not all(isinstance(one, str) for one in names):
        return None
    return _named(scan, names, name)


def _named(table: Any, names: Any, name: str) -> list[NDArray[Any]]:
    """Return the columns x, y and z, or X, Y and Z unless these are whole numbers."""
    known = [str(one) for one in names]
    for axes in (_AXES, tuple(one.upper() for one in _AXES)):
        if not set(axes) <= set(known):
            continue
        columns = [np.asarray(table[axis]) for axis in axes]
        for axis, column in zip(axes, columns, strict=True):
            if column.ndim != 1 or column.dtype.kind not in "fiu":
                raise InvalidInput(
                    f"{name}[{axis!r}] must be one real number per point, got {column.dtype} "
                    f"{column.shape}"
                )
        if axes[0] == "X" and all(column.dtype.kind in "iu" for column in columns):
            raise InvalidInput(
                f"{name} has X, Y and Z as whole numbers, the raw records of LAS; pass the scaled "
                "coordinates, las.xyz"
            )
        return columns
    raise InvalidInput(
        f"{name} must have columns x, y and z, got {', '.join(known) or 'none'}; rename them, or "
        "stack the coordinates: np.column_stack([a, b, c])"
    )


def _points_of(scan: Any, name: str) -> tuple[Any, str]:
    """Return the points of an object of another library, and their name; arrays unchanged."""
    if hasattr(scan, "__array__"):
        return scan, name
    tensors = getattr(scan, "point", None)
    if tensors is not None and hasattr(tensors, "positions"):
        return tensors.positions.cpu().numpy(), f"{name}.point.positions"
    for attribute in _ATTRIBUTES:
        points = getattr(scan, attribute, None)
        if points is not None:
            return points, f"{name}.{attribute}"
    return scan, name


def _as_array(array: Any, name: str) -> NDArray[Any]:
    if isinstance(array, np.ma.MaskedArray) and array.dtype.kind in "fiu":
        # Masked entries must not be used.
        kind = np.promote_types(array.dtype, np.float32)
        array = np.ma.filled(array.astype(kind), np.nan)
    try:
        return np.asarray(array)
    except ValueError as error:
        raise InvalidInput(f"{name} must be an (n, 3) array: {error}") from error


def _checked(raw: NDArray[Any], given: Any, name: str) -> Points:
    """Return the first three columns of an array after checks of its shape and type."""
    if raw.ndim == 0 and raw.dtype.kind == "O":
        raise InvalidInput(
            f"{name} must be an (n, 3) array, a table with columns x, y and z, or an object with "
            f"points, got {type(given).__name__}; convert it with np.asarray"
        )
    if raw.ndim != 2 or raw.shape[1] < 3:
        raise InvalidInput(f"{name} must have shape (n, 3) or wider, got {raw.shape}")
    if len(raw) <= _MAX_TRANSPOSED_ROWS and raw.shape[1] >= _MIN_TRANSPOSED_COLUMNS:
        raise InvalidInput(
            f"{name} must have one point in each row, got shape {raw.shape}; transpose it: {name}.T"
        )
    if raw.dtype.kind not in "fiu":
        remedy = "; convert it: .astype(np.float64)" if raw.dtype.kind == "O" else ""
        raise InvalidInput(f"{name} must hold real numbers, got dtype {raw.dtype}{remedy}")
    # Freezing the slice leaves the input array writable. Kernels are compiled for aligned
    # memory, which a view into the bytes of a file may not be.
    xyz = raw[:, :3]
    if xyz.dtype == np.float64 and xyz.flags.c_contiguous and xyz.flags.aligned:
        return xyz
    return _filled([xyz[:, axis] for axis in range(3)], len(xyz))


def _filled(columns: list[NDArray[Any]], count: int) -> Points:
    """Return the columns as one float64 array."""
    converted = np.empty((count, 3), np.float64)
    # By column: NumPy converts rows of three numbers at half the speed. Extended precision may
    # exceed the range of float64; such entries become Inf.
    with np.errstate(over="ignore"):
        for axis, column in enumerate(columns):
            converted[:, axis] = column
    return converted
