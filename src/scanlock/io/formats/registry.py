"""Registry of scan formats, and detection of the format of a file."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.formats.float32_bin import read_bin, write_bin
from scanlock.io.formats.las.read import read_las
from scanlock.io.formats.las.write import write_las
from scanlock.io.formats.npy import read_npy, read_npz, write_npy, write_npz
from scanlock.io.formats.pcd import read_pcd, write_pcd
from scanlock.io.formats.ply import read_ply, write_ply
from scanlock.io.formats.text import read_text, write_text
from scanlock.io.scan_file import ScanFile

Reader = Callable[[Path, bytes, tuple[str, ...] | int | None], ScanFile]
"""Function of path (for messages), contents and requested columns that returns the scan."""

Writer = Callable[[Path, BinaryIO, ScanFile, str], None]
"""Function of path (for messages and variants), open file, scan and encoding that writes it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFormat:
    """Reader, writer and properties of a scan format."""

    title: str
    """Name for display."""

    extensions: tuple[str, ...]
    """Extensions of file names, lower case, the usual one first."""

    read: Reader
    """Reader of scans."""

    write: Writer
    """Writer of scans."""

    encodings: tuple[str, ...]
    """Encodings of the writer, the default first."""

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
        extensions=(".txt", ".xyz", ".csv", ".asc", ".pts", ".3d"),
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
}

_FOREIGN = {
    b"# vtk": "VTK",
    b"ASTM-E57": "E57",
    b"#ROSBAG": "ROS bag",
    b"\x89MCAP": "MCAP",
    b"SQLite": "SQLite (ROS 2 bag)",
    b"\x89HDF": "HDF5",
    b"\x1f\x8b\x08": "gzip",
    b"\xd4\xc3\xb2\xa1": "pcap packet capture",
    b"\xa1\xb2\xc3\xd4": "pcap packet capture",
    b"\x0a\x0d\x0d\x0a": "pcapng packet capture",
    b"\x89PNG": "PNG",
    b"ARROW1": "Feather",
    b"PAR1": "Parquet",
}
"""First bytes and names of formats that are recognised but not read."""

_WITHOUT_MAGIC = ("bin", "txt")
"""Formats that the extension alone decides: raw float32, and text that is not ASCII."""

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
    for magic, title in _FOREIGN.items():
        if data.startswith(magic):
            raise FormatError(
                f"{path}: byte 0: expected a scan, found a {title} file; convert it to one of "
                f"{', '.join(FORMATS)} first"
            )
    for magic, name in ((b"LASF", "las"), (b"\x93NUMPY", "npy"), (b"PK\x03\x04", "npz")):
        if data.startswith(magic):
            return name
    if data.startswith((b"ply\n", b"ply\r")):
        return "ply"
    head = data[:_PREVIEW]
    lines = [line.strip() for line in head.split(b"\n")]
    first = next((line for line in lines if line and not line.startswith(b"#")), b"")
    if head.startswith(b"# .PCD") or first.startswith(_PCD_KEYS):
        return "pcd"
    return "txt" if _TEXT_BYTES.issuperset(head) and head.isascii() else None


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
    if named is not None and (found == named or (found is None and named in _WITHOUT_MAGIC)):
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


def require_format(name: str) -> str:
    """Return the name of a format; raise `InvalidInput` with the known ones if it is unknown."""
    if name not in FORMATS:
        raise InvalidInput(f"format must be one of {', '.join(FORMATS)}, got {name!r}")
    return name
