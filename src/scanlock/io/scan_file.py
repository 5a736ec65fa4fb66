"""Contents of a scan file: points in metres and fields, with notes on all that was guessed."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, frozen, short_repr
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.columns import Request, find_coordinates, select_columns, unique_names
from scanlock.io.crs.coordinate_system import CoordinateSystem
from scanlock.io.errors import malformed
from scanlock.io.las_properties import LasProperties

Field = NDArray[Any]
"""(n,) or (n, k) values, one row for each point."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanFile:
    """Contents of one scan file, with its rows and frame, in metres.

    Rows with NaN or Inf are kept, so that labels and masks match the rows of the file;
    `scanlock.clouds.point_cloud.PointCloud` removes and counts them.

    Raises
    ------
    InvalidInput
        Points or fields of a wrong shape or type, no points, or a width and height that do not
        match the number of points.
    """

    points: Points
    """(n, 3) coordinates [m] as float64; n is at least 1. Degrees if `crs` is geographic."""

    fields: Mapping[str, Field]
    """All other columns by name, in the order and type of the file."""

    format: str
    """Format of the file: a key of `scanlock.io.FORMATS`."""

    encoding: str = ""
    """Encoding within the format: ``"ascii"``, ``"binary"``, ``"binary_compressed"``, ..."""

    coordinate_dtype: str = "float64"
    """Type of the coordinates in the file."""

    width: int = 0
    """Number of columns of an organised cloud; by default the number of points."""

    height: int = 1
    """Number of rows of an organised cloud; 1 otherwise."""

    viewpoint: Pose | None = None
    """Pose of the sensor in the frame of the points, for formats that store one (PCD)."""

    station: str = ""
    """Name of the station, for formats that name their scans (E57)."""

    file_from_station: Pose | None = None
    """Pose of the station in the frame of the file, for formats that store one (E57, PTX).

    The points are in the frame of the station, with the scanner at the origin by convention;
    ``scan.file_from_station @ scan.points`` are in the frame of the file. None if the file has
    no pose.
    """

    crs: CoordinateSystem | None = None
    """Coordinate reference system; None if the file states none. `write_scan` writes LAS files in
    its unit."""

    metres_per_unit: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Factors of x, y and z from the unit of the file to metres, applied on reading."""

    las: LasProperties | None = None
    """Version, point format, scales and records of a LAS file, kept for writing."""

    notes: tuple[str, ...] = ()
    """Notes of the reader, one for each property that was inferred rather than read."""

    __repr__ = short_repr

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
        # Only views are made read-only, so that the arrays of the caller stay writable.
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
    *,
    request: Request = None,
    named: bool = True,
    **attributes: Any,
) -> ScanFile:
    """Build a scan from named columns; x, y and z become the points.

    Parameters
    ----------
    path : Path
        The file, for messages.
    names, columns : sequences of equal length
    request, named
        Columns that the caller wants, and whether the names are those of the file; see
        `scanlock.io.columns.select_columns`.
    **attributes
        Further attributes of `ScanFile`: ``format``, ``notes``, ...

    Raises
    ------
    FormatError
        Names without x, y and z, coordinates that are not scalar numbers, no row, or columns
        that the file does not have.
    """
    chosen = select_columns(path, unique_names(names), request, named=named)
    names = [name for name, _ in chosen]
    columns = [columns[index] for _, index in chosen]
    axes = find_coordinates(names)
    if axes is None:
        raise malformed(
            path,
            "header",
            expected="columns named x, y and z",
            found=", ".join(names),
            remedy='say which they are, as in columns="x=easting y=northing z=height"',
        )
    count = len(columns[axes[0]])
    if count == 0:
        raise malformed(
            path,
            "data",
            expected="at least one point",
            found="none",
            remedy="check the program that wrote it",
        )
    points = np.empty((count, 3))
    for axis, index in enumerate(axes):
        column = columns[index]
        if column.ndim != 1 or column.dtype.kind not in "fiu":
            raise malformed(
                path,
                "header",
                expected=f"one number per point for {'xyz'[axis]}",
                found=f"{column.dtype} of shape {column.shape}",
                remedy="store the coordinates as three scalar columns",
            )
        # A signalling NaN is kept like any other NaN, without a warning.
        with np.errstate(invalid="ignore"):
            points[:, axis] = column
    fields = {
        name: _native_copy(column)
        for index, (name, column) in enumerate(zip(names, columns, strict=True))
        if index not in axes
    }
    stored = np.result_type(*(columns[index].dtype for index in axes))
    attributes.setdefault("coordinate_dtype", stored.newbyteorder("=").name)
    return ScanFile(points=points, fields=fields, **attributes)


def flat_fields(path: Path, scan: ScanFile, whole: Collection[str] = ()) -> dict[str, Field]:
    """Return the fields as single columns; (n, k) fields become ``name_0``, ``name_1``, ...

    Parameters
    ----------
    path : Path
        The file, for messages.
    scan : ScanFile
    whole : collection of str
        Names of (n, k) fields to leave as they are.

    Raises
    ------
    InvalidInput
        Two columns would have the same name.
    """
    flat: dict[str, Field] = {}
    for name, values in scan.fields.items():
        columns = [(name, values)]
        if values.ndim == 2 and name not in whole:
            columns = [(f"{name}_{k}", part) for k, part in enumerate(values.T)]
        for label, column in columns:
            if label in flat:
                raise InvalidInput(f"{path}: two fields would be named {label}; rename one of them")
            flat[label] = column
    return flat


def _native_copy(column: Field) -> Field:
    """Return a contiguous copy in native byte order, independent of the buffer of the file."""
    return np.array(column, dtype=column.dtype.newbyteorder("="), order="C")
