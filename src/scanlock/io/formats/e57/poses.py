"""Poses of the stations of an E57 file, changed in the file itself.

An E57 file consists of pages of 1020 bytes and a CRC-32C each. The logical contents without the
checksums begin with a header of 48 bytes; the points and images follow as binary sections, and an
XML section, last in the files of all common programs, holds the poses. Only the XML section, the
header and the checksums of their pages are written anew.
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, BinaryIO
from xml.parsers import expat

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import malformed, require_regular_file
from scanlock.io.formats.e57.library import HEADER, PAGE_SIZE, REMEDY, read_header

_PAYLOAD = PAGE_SIZE - 4
_STATION = ["e57Root", "data3D", "vectorChild"]
_POLYNOMIAL = 0x82F63B78
"""Polynomial of CRC-32C, reflected."""


def write_e57_poses(
    source: str | os.PathLike[str],
    output: str | os.PathLike[str],
    poses: Sequence[Pose | None],
) -> None:
    """Copy an E57 file with other poses of its stations; points and images keep every byte.

    Poses of images are left as they are. pye57 is not needed.

    Parameters
    ----------
    source, output : path-like
        The files; they may be the same.
    poses : sequence of Pose or None
        ``file_from_station`` of each station, in the order of the file; None keeps a pose.

    Raises
    ------
    InvalidInput
        Another number of poses than of stations.
    FormatError
        A source that is damaged or no E57 file.
    FileNotFoundError
        The source, or the folder of the output, does not exist.
    """
    path = Path(source)
    require_regular_file(path, "E57")
    with path.open("rb") as file, atomic_file(output) as handle:
        size, offset, length = read_header(path, file.read(HEADER.size))
        if size != path.stat().st_size:
            raise malformed(
                path,
                "header",
                expected=f"a file of {size} bytes",
                found=str(path.stat().st_size),
                remedy=REMEDY,
            )
        start = offset // PAGE_SIZE * _PAYLOAD + offset % PAGE_SIZE
        xml = _payload(path, file, start, length)
        changed = _with_poses(path, xml, poses)
        last_page = size // PAGE_SIZE - 1
        if (start + length - 1) // _PAYLOAD != last_page:
            # Other sections follow: the new section is appended, and the old one is unused.
            start = (last_page + 1) * _PAYLOAD
        _write(path, file, handle, start, changed)


def _write(path: Path, file: BinaryIO, handle: BinaryIO, start: int, xml: bytes) -> None:
    """Copy the pages before the new XML section, and write it with a new header."""
    first = start // _PAYLOAD
    tail = _payload(path, file, first * _PAYLOAD, start % _PAYLOAD) + xml
    pages = -(-len(tail) // _PAYLOAD)
    file.seek(0)
    signature, major, minor, *_ = HEADER.unpack(file.read(HEADER.size))
    header = HEADER.pack(
        signature,
        major,
        minor,
        (first + pages) * PAGE_SIZE,
        first * PAGE_SIZE + start % _PAYLOAD,
        len(xml),
        PAGE_SIZE,
    )
    if first == 0:
        tail = header + tail[HEADER.size :]
    else:
        handle.write(_sealed(header + _payload(path, file, HEADER.size, _PAYLOAD - HEADER.size)))
        file.seek(PAGE_SIZE)
        _copy(file, handle, (first - 1) * PAGE_SIZE)
    tail = tail.ljust(pages * _PAYLOAD, b" ")
    for k in range(pages):
        handle.write(_sealed(tail[k * _PAYLOAD : (k + 1) * _PAYLOAD]))


def _copy(file: BinaryIO, handle: BinaryIO, size: int) -> None:
    while size > 0:
        part = file.read(min(size, 1 << 24))
        if not part:
            return
        handle.write(part)
        size -= len(part)


def _payload(path: Path, file: BinaryIO, start: int, length: int) -> bytes:
    """Return bytes of the logical contents, after a check of their checksums."""
    first, last = start // _PAYLOAD, -(-(start + length) // _PAYLOAD)
    file.seek(first * PAGE_SIZE)
    parts: list[bytes] = []
    for number in range(first, last):
        page = file.read(PAGE_SIZE)
        if len(page) < PAGE_SIZE or _sealed(page[:_PAYLOAD]) != page:
            raise malformed(
                path,
                f"byte {number * PAGE_SIZE}",
                expected="a page with its checksum",
                found="another checksum or the end of the file",
                remedy=REMEDY,
            )
        parts.append(page[:_PAYLOAD])
    at = start - first * _PAYLOAD
    return b"".join(parts)[at : at + length]


def _sealed(payload: bytes) -> bytes:
    """Return a page: the payload and its CRC-32C, big-endian."""
    crc = 0xFFFFFFFF
    for byte in payload:
        crc = _TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return payload + (crc ^ 0xFFFFFFFF).to_bytes(4, "big")


def _crc_of_byte(value: int) -> int:
    for _ in range(8):
        value = (value >> 1) ^ (_POLYNOMIAL if value & 1 else 0)
    return value


_TABLE = tuple(_crc_of_byte(value) for value in range(256))


def _with_poses(path: Path, xml: bytes, poses: Sequence[Pose | None]) -> bytes:
    """Return the XML section with other poses, and all else unchanged."""
    places = _PosePlaces(path, xml).found
    if len(poses) != len(places):
        raise InvalidInput(
            f"{path}: poses must be one for each of the {len(places)} stations, got {len(poses)}"
        )
    for (first, end), pose in reversed(list(zip(places, poses, strict=True))):
        if pose is not None:
            xml = xml[:first] + _pose_text(pose) + xml[end:]
    return xml


class _PosePlaces:
    """Places of the poses in the XML section; empty ones where a pose is to be inserted."""

    def __init__(self, path: Path, xml: bytes) -> None:
        self.path = path
        self.xml = xml
        self.stack: list[str] = []
        self.first: int | None = None
        self.insertion: int | None = None
        self.pose: tuple[int, int] | None = None
        self.found: list[tuple[int, int]] = []
        self.parser: Any = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        try:
            self.parser.Parse(xml, True)
        except expat.ExpatError as error:
            raise malformed(
                path,
                "XML section",
                expected="well-formed XML",
                found=str(error),
                remedy=REMEDY,
            ) from error

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        at = self.parser.CurrentByteIndex
        if self.stack == _STATION:
            if name == "pose":
                self.first = at
            elif self.insertion is None:
                self.insertion = at
        self.stack.append(name)

    def _end(self, name: str) -> None:
        end = self.xml.index(b">", self.parser.CurrentByteIndex) + 1
        self.stack.pop()
        if self.stack == _STATION and name == "pose" and self.first is not None:
            self.pose = self.first, end
        if [*self.stack, name] == _STATION:
            if self.insertion is None:
                raise malformed(
                    self.path,
                    "XML section",
                    expected="stations with a name and points",
                    found="an empty one",
                    remedy=REMEDY,
                )
            self.found.append(self.pose or (self.insertion, self.insertion))
            self.first = self.insertion = self.pose = None


def _pose_text(pose: Pose) -> bytes:
    quaternion = zip("wxyz", quaternion_from_rotation(pose.rotation).tolist(), strict=True)
    translation = zip("xyz", pose.translation.tolist(), strict=True)
    parts = [
        f'<{key} type="Structure">'
        + "".join(f'<{axis} type="Float">{value!r}</{axis}>' for axis, value in values)
        + f"</{key}>"
        for key, values in (("rotation", quaternion), ("translation", translation))
    ]
    return f'<pose type="Structure">{"".join(parts)}</pose>'.encode("ascii")
