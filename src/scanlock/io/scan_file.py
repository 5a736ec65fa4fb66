"""A scan as its file holds it: nothing dropped, nothing moved, every guess on record."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, frozen
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.columns import distinct_names, find_coordinates
from scanlock.io.errors import malformed

Field = NDArray[Any]
"""(n,) or (n, k) values that belong to the points row by row."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanFile:
    """The contents of one scan file, in the file's own rows, units and frame.

    Rows with NaN or Inf are kept, so that labels and masks computed later line up with the
    file; `scanlock.clouds.point_cloud.PointCloud` is the gate that leaves them out and counts
    them.
    """

    points: Points
    """(n, 3) coordinates as stored, widened to float64; n is at least 1."""

    fields: Mapping[str, Field]
    """Every other column by its name in the file, in the file's order and type."""

    format: str
    """The key of `scanlock.io.FORMATS` that read it."""

    encoding: str = ""
    """How the format stored it: ``"ascii"``, ``"binary"``, ``"binary_compressed"``, ..."""

    coordinate_dtype: str = "float64"
    """The type the coordinates have in the file."""

    width: int = 0
    """Columns of an organised cloud; the number of points otherwise, and the default."""

    height: int = 1
    """Rows of an organised cloud; 1 otherwise."""

    viewpoint: Pose | None = None
    """Pose of the sensor in the frame of the points, where the format has one (PCD)."""

    notes: tuple[str, ...] = ()
    """What the reader inferred rather than read, one sentence each."""

    def __post_init__(self) -> None:
        points = self.points.view()
        if points.ndim != 2 or points.shape[1] != 3 or points.dtype != np.float64:
            raise InvalidInput(
                f"points must be an (n, 3) float64 array, got {points.dtype} {points.shape}"
            )
        if len(points) == 0:
            raise InvalidInput("points must hold at least one row, got none")
        width = self.width or len(points)
        if width * self.height != len(points):
            raise InvalidInput(
                f"width x height must be the number of points, got {width} x {self.height} for "
                f"{len(points)}"
            )
        fields = {name: np.asarray(values).view() for name, values in self.fields.items()}
        for name, values in fields.items():
            if name in ("x", "y", "z") or values.ndim not in (1, 2) or len(values) != len(points):
                raise InvalidInput(
                    f"a field must not be named x, y or z and must have a row for each of the "
                    f"{len(points)} points, got {name!r} of shape {values.shape}"
                )
        # Views are frozen, so that the arrays a caller handed in stay writable.
        for array in (points, *fields.values()):
            frozen(array)
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "fields", MappingProxyType(fields))
        object.__setattr__(self, "width", width)

    def __len__(self) -> int:
        return len(self.points)

    def __reduce__(self) -> tuple[Any, ...]:
        state = {name: getattr(self, name) for name in self.__slots__}
        state["fields"] = dict(self.fields)
        return _rebuilt, (state,)


def _rebuilt(state: dict[str, Any]) -> ScanFile:
    return ScanFile(**state)


def scan_from_columns(
    path: Path,
    names: Sequence[str],
    columns: Sequence[Field],
    **attributes: Any,
) -> ScanFile:
    """Return the scan whose columns carry these names; x, y and z become the points.

    Further `attributes` (``format``, ``notes``, ...) go to `ScanFile` as they are.

    Raises
    ------
    FormatError
        No x, y, z among the names, coordinates that are no plain numbers, or no row.
    """
    names = distinct_names(names)
    places = find_coordinates(names)
    if places is None:
        raise malformed(
            path,
            "header",
            expected="columns named x, y and z",
            found=", ".join(names),
            remedy="rename them, or name the columns in order where the format allows it",
        )
    count = len(columns[places[0]])
    if count == 0:
        raise malformed(
            path,
            "data",
            expected="at least one point",
            found="none",
            remedy="check the program that wrote it",
        )
    points = np.empty((count, 3))
    for axis, place in enumerate(places):
        column = columns[place]
        if column.ndim != 1 or column.dtype.kind not in "fiu":
            raise malformed(
                path,
                "header",
                expected=f"one number a point for {'xyz'[axis]}",
                found=f"{column.dtype} of shape {column.shape}",
                remedy="store the coordinates as three scalar columns",
            )
        # A signalling NaN is one more row without a place, and no reason for a warning.
        with np.errstate(invalid="ignore"):
            points[:, axis] = column
    fields = {
        name: native(column)
        for place, (name, column) in enumerate(zip(names, columns, strict=True))
        if place not in places
    }
    stored = np.result_type(*(columns[place].dtype for place in places))
    attributes.setdefault("coordinate_dtype", stored.newbyteorder("=").name)
    return ScanFile(points=points, fields=fields, **attributes)


def flat_fields(path: Path, scan: ScanFile) -> dict[str, Field]:
    """Return the fields one column each: those of k values a point as ``name_0``, ``name_1``, ...

    Raises
    ------
    InvalidInput
        Two columns would get one name.
    """
    flat: dict[str, Field] = {}
    for name, values in scan.fields.items():
        columns = [(name, values)]
        if values.ndim == 2:
            columns = [(f"{name}_{k}", part) for k, part in enumerate(values.T)]
        for label, column in columns:
            if label in flat:
                raise InvalidInput(f"{path}: two fields would be called {label}; rename one")
            flat[label] = column
    return flat


def native(column: Field) -> Field:
    """Return a contiguous copy in this machine's byte order, free of the file's buffer."""
    return np.array(column, dtype=column.dtype.newbyteorder("="), order="C")
