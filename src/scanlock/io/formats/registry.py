"""Every format by name, and how a file is told to be in one."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from scanlock.errors import FormatError, InvalidInput
from scanlock.io.formats.float32_bin import read_bin, write_bin
from scanlock.io.formats.las import read_las, write_las
from scanlock.io.formats.npy import read_npy, read_npz, write_npy, write_npz
from scanlock.io.formats.pcd import read_pcd, write_pcd
from scanlock.io.formats.ply import read_ply, write_ply
from scanlock.io.formats.text import read_text, write_text
from scanlock.io.scan_file import ScanFile

Reader = Callable[[Path, bytes, tuple[str, ...] | int | None], ScanFile]
"""Path (for messages), contents, the caller's columns -> scan."""

Writer = Callable[[Path, BinaryIO, ScanFile, str], None]
"""Path (for messages and variants), open file, scan, encoding."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScanFormat:
    """One way to keep a scan in a file."""

    title: str
    """What people call it."""

    extensions: tuple[str, ...]
    """Endings of file names, lower case, the usual one first."""

    read: Reader
    """Turns contents into a scan."""

    write: Writer
    """Turns a scan into contents."""

    encodings: tuple[str, ...]
    """What the writer's `encoding` may be, the default first."""

    organised: bool = False
    """Whether it keeps the width, height and viewpoint of an organised cloud."""


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
"""First bytes of files that people mistake for scans, or wish were ones."""

_WITHOUT_MAGIC = ("bin", "txt")
"""Raw float32 is told by its name only, and text need not be ASCII."""

_PREVIEW = 4096
_TEXT_BYTES = frozenset(range(32, 256)) | set(b"\t\n\v\f\r")
_PCD_KEYS = (b"VERSION", b"FIELDS", b"COLUMNS")


def format_of_name(path: Path) -> str | None:
    """Return the format that a file name's ending stands for; None if for none."""
    suffix = path.suffix.lower()
    return next((name for name, known in FORMATS.items() if suffix in known.extensions), None)


def format_of_content(path: Path, data: bytes) -> str | None:
    """Return the format that the first bytes speak for; None where they are plain binary.

    Raises
    ------
    FormatError
        They belong to a known format that is not read here.
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


def settled_format(path: Path, data: bytes, requested: str | None) -> str:
    """Return the format to read a file as: the caller's word, or what name and content agree on.

    Raises
    ------
    InvalidInput
        `requested` is no format.
    FormatError
        The content disagrees with the name, or neither tells.
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
            f"{path}: neither the name ({path.suffix or 'no extension'}) nor the content tells "
            f"the format; pass format= as one of {', '.join(FORMATS)}"
        )
    described = FORMATS[found].title if found else "unknown binary data"
    remedy = f'rename it, or pass format="{found}"' if found else "it is damaged or mislabelled"
    raise FormatError(
        f"{path}: byte 0: expected {FORMATS[named].title}, as the ending {path.suffix} says, "
        f"found {described}; {remedy}"
    )


def require_format(name: str) -> str:
    """Return the name of a format, or raise `InvalidInput` with all of them."""
    if name not in FORMATS:
        raise InvalidInput(f"format must be one of {', '.join(FORMATS)}, got {name!r}")
    return name
