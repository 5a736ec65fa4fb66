"""Writing of E57: stations with their poses, names and fields."""

import shutil
import tempfile
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.columns import require_writable_names
from scanlock.io.formats.column_storage import with_common_type
from scanlock.io.formats.e57.library import FIELDS, INVALID, NAMES, NORMALS, buffer_type, libe57
from scanlock.io.scan_file import Field, ScanFile, flat_fields

_DEFINED = frozenset(NAMES.values()) | {
    "intensity",
    "returnIndex",
    "returnCount",
    "isColorInvalid",
    "isIntensityInvalid",
    "isTimeStampInvalid",
    "sphericalRange",
    "sphericalAzimuth",
    "sphericalElevation",
}
"""Our names of the fields that E57 or its extension for normals defines."""

_E57_NAMES = {ours: name for name, ours in NAMES.items()}


def write_e57(path: Path, handle: BinaryIO, scan: ScanFile, encoding: str) -> None:
    """Write one station; see `write_e57_stations`."""
    write_e57_stations(path, handle, [scan])


def write_e57_stations(path: Path, handle: BinaryIO, scans: Sequence[ScanFile]) -> None:
    """Write stations; NaN points are marked invalid.

    Raises
    ------
    InvalidInput
        A field that E57 cannot hold.
    MissingExtra
        pye57 is not installed.
    """
    library = libe57(path)
    checked = [_storable_fields(path, scan) for scan in scans]
    with tempfile.TemporaryDirectory() as folder:
        written = Path(folder) / "a.e57"
        file = library.ImageFile(str(written), "w")
        try:
            _write_root(library, file)
            for number, (scan, fields) in enumerate(zip(scans, checked, strict=True), 1):
                _write_station(library, file, scan, fields, scan.station or f"Station {number}")
        finally:
            file.close()
        with written.open("rb") as stream:
            shutil.copyfileobj(stream, handle)


def _write_root(library: Any, file: Any) -> None:
    file.extensionsAdd("", library.E57_V1_0_URI)
    file.extensionsAdd(*NORMALS)
    file.extensionsAdd(*FIELDS)
    root = file.root()
    root.set("formatName", library.StringNode(file, "ASTM E57 3D Imaging Data File"))
    root.set("guid", library.StringNode(file, _guid()))
    root.set("versionMajor", library.IntegerNode(file, library.E57_FORMAT_MAJOR))
    root.set("versionMinor", library.IntegerNode(file, library.E57_FORMAT_MINOR))
    root.set("e57LibraryVersion", library.StringNode(file, library.E57_LIBRARY_ID))
    root.set("data3D", library.VectorNode(file, True))
    root.set("images2D", library.VectorNode(file, True))


def _write_station(
    library: Any, file: Any, scan: ScanFile, fields: dict[str, Field], name: str
) -> None:
    columns = _columns(scan, fields)
    station = library.StructureNode(file)
    station.set("guid", library.StringNode(file, _guid()))
    station.set("name", library.StringNode(file, name))
    if scan.file_from_station is not None:
        station.set("pose", _pose_node(library, file, scan.file_from_station))
    for key, bounds in _bounds(scan, fields).items():
        station.set(key, _structure(library, file, bounds))
    prototype = library.StructureNode(file)
    for key, values in columns.items():
        prototype.set(key, _number_node(library, file, values))
    points = library.CompressedVectorNode(file, prototype, library.VectorNode(file, True))
    station.set("points", points)
    file.root()["data3D"].append(station)
    buffers = library.VectorSourceDestBuffer()
    # The library does not keep the arrays that it copies from.
    arrays = {key: part.astype(buffer_type(part.dtype)) for key, part in columns.items()}
    for key, values in arrays.items():
        buffers.append(library.SourceDestBuffer(file, key, values, len(scan), True, True))
    writer = points.writer(buffers)
    writer.write(len(scan))
    writer.close()


def _columns(scan: ScanFile, fields: dict[str, Field]) -> dict[str, Field]:
    """Return the columns by their names in E57."""
    finite = np.isfinite(scan.points).all(axis=1)
    points = scan.points.astype("f4" if scan.coordinate_dtype == "float32" else "f8")
    points[~finite] = 0.0
    columns: dict[str, Field] = {
        f"cartesian{axis}": np.ascontiguousarray(points[:, k]) for k, axis in enumerate("XYZ")
    }
    if not finite.all():
        state = np.clip(scan.fields.get(INVALID, np.full(len(scan), 2)), 1, 2)
        columns["cartesianInvalidState"] = np.where(finite, 0, state).astype(np.uint8)
    for name, values in fields.items():
        if name not in _DEFINED:
            columns[f"{FIELDS[0]}:{name}"] = values
        elif name != INVALID:
            columns[_E57_NAMES.get(name, name)] = values
    return columns


def _storable_fields(path: Path, scan: ScanFile) -> dict[str, Field]:
    fields = {key: part for key, part in flat_fields(path, scan).items() if key != INVALID}
    require_writable_names(path, fields)
    return {name: _storable(path, name, values) for name, values in fields.items()}


def _storable(path: Path, name: str, values: Field) -> Field:
    values = with_common_type(values)
    kind, size = values.dtype.kind, values.dtype.itemsize
    if name not in _DEFINED and not (name[0].isalpha() and name.replace("_", "").isalnum()):
        raise InvalidInput(
            f"{path}: a field name of E57 must be letters, digits and underscores, got {name!r}; "
            "rename it"
        )
    if kind == "u" and size == 8 and int(values.max()) < 2**63:
        values = values.astype(np.int64)
    elif kind not in "iuf" or size > 8 or (kind == "u" and size == 8):
        raise InvalidInput(
            f"{path}: E57 cannot hold field {name} of type {values.dtype}; convert it to numbers "
            "of at most 8 bytes, below 2^63"
        )
    return np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))


def _number_node(library: Any, file: Any, values: Field) -> Any:
    """Return the description of a column, with the bounds of its type."""
    if values.dtype.kind == "f":
        precision = library.E57_SINGLE if values.dtype.itemsize == 4 else library.E57_DOUBLE
        return library.FloatNode(file, 0.0, precision)
    limits = np.iinfo(values.dtype)
    return library.IntegerNode(file, 0, int(limits.min), int(limits.max))


def _pose_node(library: Any, file: Any, pose: Pose) -> Any:
    node = library.StructureNode(file)
    quaternion = quaternion_from_rotation(pose.rotation).tolist()
    rotation = dict(zip("wxyz", quaternion, strict=True))
    node.set("rotation", _structure(library, file, rotation))
    translation = dict(zip("xyz", pose.translation.tolist(), strict=True))
    node.set("translation", _structure(library, file, translation))
    return node


def _bounds(scan: ScanFile, fields: dict[str, Field]) -> dict[str, dict[str, float | int]]:
    """Return the bounds that viewers use: of the coordinates, the intensity and the colours."""
    finite = scan.points[np.isfinite(scan.points).all(axis=1)]
    bounds: dict[str, dict[str, float | int]] = {}
    if len(finite):
        low, high = finite.min(axis=0).tolist(), finite.max(axis=0).tolist()
        bounds["cartesianBounds"] = {
            f"{axis}{end}": values[k]
            for k, axis in enumerate("xyz")
            for end, values in (("Minimum", low), ("Maximum", high))
        }
    intensity = fields.get("intensity")
    if intensity is not None and np.isfinite(intensity).all():
        ends = float(intensity.min()), float(intensity.max())
        bounds["intensityLimits"] = dict(
            zip(("intensityMinimum", "intensityMaximum"), ends, strict=True)
        )
    if all(key in fields and fields[key].dtype.kind in "iu" for key in ("red", "green", "blue")):
        largest = int(np.iinfo(fields["red"].dtype).max)
        bounds["colorLimits"] = {
            f"color{colour}{end}": value
            for colour in ("Red", "Green", "Blue")
            for end, value in (("Minimum", 0), ("Maximum", largest))
        }
    return bounds


def _structure(library: Any, file: Any, values: dict[str, float | int]) -> Any:
    node = library.StructureNode(file)
    for key, value in values.items():
        kind = library.IntegerNode if isinstance(value, int) else library.FloatNode
        node.set(key, kind(file, value))
    return node


def _guid() -> str:
    return f"{{{uuid.uuid4()}}}"
