"""Reading of E57: the stations of a file, with their poses, names and all numeric fields."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.io.columns import Request, require_request_of_names
from scanlock.io.errors import free_memory, malformed
from scanlock.io.formats.e57.library import (
    FIELDS,
    INVALID,
    NAMES,
    REMEDY,
    buffer_type,
    libe57,
    opened,
)
from scanlock.io.formats.stations import Station
from scanlock.io.scan_file import Field, ScanFile, scan_from_columns

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_STATES = {"cartesianInvalidState": _CARTESIAN, "sphericalInvalidState": _SPHERICAL}
_MAX_METADATA = 120
"""Characters of the coordinate system that are shown."""

_INTEGERS = ("u1", "i1", "u2", "i2", "u4", "i4")


def e57_stations(path: Path, data: bytes) -> list[Station]:
    """Return the stations of an E57 file; points are read from the path on request.

    Raises
    ------
    FormatError
        A file that is cut short or damaged.
    MissingExtra
        pye57 is not installed.
    """
    library = libe57(path)
    with opened(library, path) as file:
        root = file.root()
        scans: Sequence[Any] = root["data3D"] if root.isDefined("data3D") else ()
        return [
            Station(
                name=str(scan["name"].value()) if scan.isDefined("name") else "",
                points=int(scan["points"].childCount()) if scan.isDefined("points") else 0,
                read=partial(_read_station, path, k),
            )
            for k, scan in enumerate(scans[j] for j in range(len(scans)))
        ]


def _read_station(path: Path, index: int, columns: Request) -> ScanFile:
    require_request_of_names(path, "E57", columns)
    library = libe57(path)
    with opened(library, path) as file:
        scan = file.root()["data3D"][index]
        name = str(scan["name"].value()) if scan.isDefined("name") else ""
        notes = _metadata_notes(file.root())
        pose = _pose(path, scan, notes)
        fields = _numbers(path, library, file, scan, notes)
    names, values = _with_points(path, fields, notes)
    return scan_from_columns(
        path,
        names,
        values,
        request=columns,
        format="e57",
        encoding="binary",
        station=name,
        file_from_station=pose,
        notes=tuple(notes),
    )


def _metadata_notes(root: Any) -> list[str]:
    """Return a note of the coordinate system of the file, in which the poses are."""
    if not root.isDefined("coordinateMetadata"):
        return []
    text = " ".join(str(root["coordinateMetadata"].value()).split())
    return [f"coordinate system of the poses: {text[:_MAX_METADATA]}"] if text else []


def _pose(path: Path, scan: Any, notes: list[str]) -> Pose | None:
    """Return the pose of a station; a missing rotation or translation is none."""
    if not scan.isDefined("pose"):
        return None
    pose = scan["pose"]
    translation, quaternion = [0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]
    if pose.isDefined("translation"):
        translation = [float(pose["translation"][axis].value()) for axis in "xyz"]
    if pose.isDefined("rotation"):
        quaternion = [float(pose["rotation"][axis].value()) for axis in "wxyz"]
    if not any(quaternion):
        notes.append("pose without a rotation (0 0 0 0): read as no rotation")
        quaternion = [1.0, 0.0, 0.0, 0.0]
    try:
        return pose_from_quaternion(translation, quaternion)
    except InvalidInput as error:
        raise malformed(
            path,
            "pose of a station",
            expected="a translation and a unit quaternion",
            found=f"{translation} and {quaternion}",
            remedy=REMEDY,
        ) from error


def _numbers(path: Path, library: Any, file: Any, scan: Any, notes: list[str]) -> dict[str, Field]:
    """Return all numeric fields of the points by their names in E57."""
    points = scan["points"]
    count = int(points.childCount())
    prototype = library.StructureNode(points.prototype())
    types = {
        node.elementName(): _dtype(library, node)
        for node in (prototype.get(k) for k in range(prototype.childCount()))
    }
    left_out = [name for name, dtype in types.items() if dtype is None]
    if left_out:
        notes.append(f"fields without numbers left out: {', '.join(left_out)}")
    known = {name: np.dtype(dtype) for name, dtype in types.items() if dtype is not None}
    size = count * sum(dtype.itemsize for dtype in known.values())
    free = free_memory() or size
    if size > free:
        raise FormatError(
            f"{path}: expected a station that fits the free memory of {free / 1e9:.1f} GB, found "
            f"{count:,} points of {size / 1e9:.1f} GB; split it with another tool"
        )
    values = {name: np.empty(count, buffer_type(dtype)) for name, dtype in known.items()}
    if count == 0 or not values:
        return values
    buffers = library.VectorSourceDestBuffer()
    for name, array in values.items():
        buffers.append(library.SourceDestBuffer(file, name, array, count, True, True))
    reader = points.reader(buffers)
    read = int(reader.read())
    reader.close()
    if read != count:
        raise malformed(path, "points", expected=f"{count} points", found=str(read), remedy=REMEDY)
    return {name: part.astype(known[name], copy=False) for name, part in values.items()}


def _dtype(library: Any, node: Any) -> str | None:
    """Return the type in which all values of a field fit; None for text."""
    kind = node.type()
    if kind == library.NodeType.E57_FLOAT:
        single = library.FloatNode(node).precision() == library.FloatPrecision.E57_SINGLE
        return "f4" if single else "f8"
    if kind == library.NodeType.E57_SCALED_INTEGER:
        return "f8"
    if kind != library.NodeType.E57_INTEGER:
        return None
    integer = library.IntegerNode(node)
    low, high = int(integer.minimum()), int(integer.maximum())
    fits = (code for code in _INTEGERS if np.iinfo(code).min <= low and high <= np.iinfo(code).max)
    return next(fits, "i8")


def _with_points(
    path: Path, fields: dict[str, Field], notes: list[str]
) -> tuple[list[str], list[Field]]:
    """Return our names and values of the columns, with x, y, z and NaN for invalid points."""
    if set(_CARTESIAN) <= set(fields):
        points = [fields.pop(name) for name in _CARTESIAN]
    elif set(_SPHERICAL) <= set(fields):
        points = _cartesian(*(fields.pop(name) for name in _SPHERICAL))
        notes.append("converted from ranges and angles")
    else:
        raise malformed(
            path,
            "points",
            expected="cartesian or spherical coordinates",
            found=", ".join(fields) or "none",
            remedy="export it with coordinates",
        )
    state = np.zeros(len(points[0]), dtype=np.uint8)
    for name in _STATES:
        if name in fields:
            state = np.maximum(state, fields.pop(name).astype(np.uint8))
    invalid = int(np.count_nonzero(state))
    if invalid:
        points = [np.where(state > 0, np.array(np.nan, part.dtype), part) for part in points]
        fields[INVALID] = state
        notes.append(f"{invalid:,} points marked invalid in the file read as NaN")
    names = [NAMES.get(name, name.removeprefix(f"{FIELDS[0]}:")) for name in fields]
    return ["x", "y", "z", *names], [*points, *fields.values()]


def _cartesian(distance: Field, azimuth: Field, elevation: Field) -> list[Field]:
    azimuth, elevation = azimuth.astype(np.float64), elevation.astype(np.float64)
    horizontal = distance * np.cos(elevation)
    return [
        horizontal * np.cos(azimuth),
        horizontal * np.sin(azimuth),
        distance * np.sin(elevation),
    ]
