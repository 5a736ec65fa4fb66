"""Registry of scan formats, and detection of the format of a file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.columns import Request
from scanlock.io.errors import read_bytes, read_start
from scanlock.io.formats.e57.reader import e57_stations
from scanlock.io.formats.e57.writer import write_e57, write_e57_stations
from scanlock.io.formats.float32_bin import read_bin, write_bin
from scanlock.io.formats.foreign import refuse_foreign
from scanlock.io.formats.las.read import read_las
from scanlock.io.formats.las.write import write_las
from scanlock.io.formats.npy import read_npy, read_npz, write_npy, write_npz
from scanlock.io.formats.obj import is_obj, read_obj, write_obj
from scanlock.io.formats.pcd import read_pcd, write_pcd
from scanlock.io.formats.ply import read_ply, write_ply
from scanlock.io.formats.pts import is_pts, pts_stations, write_pts
from scanlock.io.formats.ptx import is_ptx, ptx_stations, write_ptx, write_ptx_stations
from scanlock.io.formats.stations import Lister, only_station
from scanlock.io.formats.text import read_text, write_text
from scanlock.io.formats.vtk.legacy import read_vtk, write_vtk
from scanlock.io.formats.vtk.xml import read_vtp
from scanlock.io.scan_file import ScanFile

Reader = Callable[[Path, bytes, Request], ScanFile]
"""Function of path (for messages), contents and requested columns that returns the scan."""

Writer = Callable[[Path, BinaryIO, ScanFile, str], None]
"""Function of path (for messages and variants), open file, scan and encoding that writes it."""

StationWriter = Callable[[Path, BinaryIO, Sequence[ScanFile]], None]
"""Function of path (for messages), open file and scans that writes a file of stations."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFormat:
    """Reader, writer and properties of a scan format."""

    title: str
    """Name for display."""

    extensions: tuple[str, ...]
    """Extensions of file names, lower case, the usual one first."""

    read: Reader
    """Reader of scans."""

    write: Writer | None
    """Writer of scans; None for formats that are only read."""

    encodings: tuple[str, ...]
    """Encodings of the writer, the default first."""

    stations: Lister | None = None
    """Lister of the stations of a file, for formats that hold several scans."""

    write_stations: StationWriter | None = None
    """Writer of several stations, with their poses and names, for formats that hold them."""

    opens_files: bool = False
    """Whether the reader opens the path itself, and gets the first bytes only."""

    organised: bool = False
    """Whether the format stores width, height and viewpoint of an organised cloud."""


FORMATS: dict[str, ScanFormat] = {
    "bin": ScanFormat(
        title="float32 rows (KITTI)",
        extensions=(".bin",),
        read=read_bin,
        write=write_bin,
        encodings=("binary",),
    ),
    "npy": ScanFormat(
        title="NumPy array",
        extensions=(".npy",),
        read=read_npy,
        write=write_npy,
        encodings=("binary",),
    ),
    "npz": ScanFormat(
        title="NumPy archive",
        extensions=(".npz",),
        read=read_npz,
        write=write_npz,
        encodings=("binary", "compressed"),
    ),
    "pcd": ScanFormat(
        title="PCD (Point Cloud Library)",
        extensions=(".pcd",),
        read=read_pcd,
        write=write_pcd,
        encodings=("binary", "ascii", "compressed"),
        organised=True,
    ),
    "ply": ScanFormat(
        title="PLY (Stanford polygon format)",
        extensions=(".ply",),
        read=read_ply,
        write=write_ply,
        encodings=("binary", "ascii"),
    ),
    "txt": ScanFormat(
        title="text table",
        extensions=(".txt", ".xyz", ".csv", ".asc", ".3d"),
        read=read_text,
        write=write_text,
        encodings=("ascii",),
    ),
    "las": ScanFormat(
        title="LAS or LAZ (surveying)",
        extensions=(".las", ".laz"),
        read=read_las,
        write=write_las,
        encodings=("binary", "compressed"),
    ),
    "e57": ScanFormat(
        title="E57 (terrestrial scanners)",
        extensions=(".e57",),
        read=only_station(e57_stations),
        write=write_e57,
        encodings=("binary",),
        stations=e57_stations,
        write_stations=write_e57_stations,
        opens_files=True,
    ),
    "ptx": ScanFormat(
        title="PTX (Leica)",
        extensions=(".ptx",),
        read=only_station(ptx_stations),
        write=write_ptx,
        encodings=("ascii",),
        stations=ptx_stations,
        write_stations=write_ptx_stations,
    ),
    "pts": ScanFormat(
        title="PTS (Leica)",
        extensions=(".pts",),
        read=only_station(pts_stations),
        write=write_pts,
        encodings=("ascii",),
        stations=pts_stations,
    ),
    "vtk": ScanFormat(
        title="VTK legacy",
        extensions=(".vtk",),
        read=read_vtk,
        write=write_vtk,
        encodings=("binary", "ascii"),
    ),
    "vtp": ScanFormat(
        title="VTK XML PolyData",
        extensions=(".vtp",),
        read=read_vtp,
        write=None,
        encodings=(),
    ),
    "obj": ScanFormat(
        title="OBJ (Wavefront)",
        extensions=(".obj",),
        read=read_obj,
        write=write_obj,
        encodings=("ascii",),
    ),
}

WRITABLE = tuple(name for name, known in FORMATS.items() if known.write is not None)
"""Formats that can be written."""

_MAGIC = {
    b"LASF": "las",
    b"\x93NUMPY": "npy",
    b"PK\x03\x04": "npz",
    b"ASTM-E57": "e57",
    b"# vtk DataFile": "vtk",
}
"""Formats by the first bytes of a file."""

_WITHOUT_MAGIC = ("bin", "txt", "pts", "ptx", "obj")
"""Formats that the extension alone decides: raw float32, and text that is not ASCII."""

_PLAIN_TEXT = ("pts",)
"""Formats that may be plain tables."""

_PREVIEW = 4096
_TEXT_BYTES = frozenset(range(32, 256)) | set(b"\t\n\v\f\r")
_PCD_KEYS = (b"VERSION", b"FIELDS", b"COLUMNS")


def format_of_name(path: Path) -> str | None:
    """Return the format of a file extension; None if it is unknown."""
    suffix = path.suffix.lower()
    return next((name for name, known in FORMATS.items() if suffix in known.extensions), None)


def format_of_content(path: Path, data: bytes) -> str | None:
    """Detect the format from the first bytes of a file; None if they are plain binary.

    Raises
    ------
    FormatError
        A format that is recognised but not read here.
    """
    refuse_foreign(path, data, ", ".join(FORMATS))
    for magic, name in _MAGIC.items():
        if data.startswith(magic):
            return name
    if data.startswith((b"ply\n", b"ply\r")):
        return "ply"
    head = data[:_PREVIEW]
    lines = [line.strip() for line in head.split(b"\n")]
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    if head.startswith(b"# .PCD") or first.startswith(_PCD_KEYS):
        return "pcd"
    if head.lstrip().startswith((b"<VTKFile", b"<?xml")) and b"<VTKFile" in head:
        return "vtp"
    if not (_TEXT_BYTES.issuperset(head) and head.isascii()):
        return None
    tests = (("ptx", is_ptx), ("pts", is_pts), ("obj", is_obj))
    return next((name for name, is_format in tests if is_format(head)), "txt")


def detect_format(path: Path, data: bytes, requested: str | None) -> str:
    """Return the requested format, else the one on which extension and content agree.

    Raises
    ------
    InvalidInput
        An unknown requested format.
    FormatError
        Extension and content disagree, or neither is that of a format.
    """
    if requested is not None:
        return require_format(requested)
    named, found = format_of_name(path), format_of_content(path, data)
    if named is not None and (
        found == named
        or (found is None and named in _WITHOUT_MAGIC)
        or (found == "txt" and named in _PLAIN_TEXT)
    ):
        return named
    if named is None and found is not None:
        return found
    if named is None:
        raise FormatError(
            f"{path}: neither the extension ({path.suffix or 'none'}) nor the content is that of a "
            f"scan format; pass format= as one of {', '.join(FORMATS)}"
        )
    described = FORMATS[found].title if found else "unknown binary data"
    remedy = f'rename it, or pass format="{found}"' if found else "it is damaged or mislabelled"
    raise FormatError(
        f"{path}: byte 0: expected {FORMATS[named].title} for the extension {path.suffix}, "
        f"found {described}; {remedy}"
    )


def open_contents(path: Path, requested: str | None) -> tuple[ScanFormat, bytes]:
    """Return the format of a file, and its contents or, if the reader opens it, its beginning.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError, InvalidInput
        As for `detect_format`; or a folder, a device, an empty or too large file.
    """
    start = read_start(path, "scan")
    known = FORMATS[detect_format(path, start, requested)]
    return known, start if known.opens_files else read_bytes(path, "scan")


def require_format(name: str) -> str:
    """Return the name of a format; raise `InvalidInput` with the known ones if it is unknown."""
    if name not in FORMATS:
        raise InvalidInput(f"format must be one of {', '.join(FORMATS)}, got {name!r}")
    return name
