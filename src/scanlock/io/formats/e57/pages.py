"""Pages of an E57 file: 1020 bytes of the logical contents and their CRC-32C each.

The logical contents begin with a header of 48 bytes. The points and images follow as binary
sections, and an XML section describes them; it is last in the files of all common programs.
"""

from pathlib import Path
from typing import BinaryIO

from scanlock.io.errors import malformed
from scanlock.io.formats.e57.library import HEADER, PAGE_SIZE, REMEDY, read_header

_PAYLOAD = PAGE_SIZE - 4
_POLYNOMIAL = 0x82F63B78
"""Polynomial of CRC-32C, reflected."""

_COPIED = 1 << 24
"""Number of bytes that are copied at once."""


def read_xml(path: Path, file: BinaryIO) -> bytes:
    """Return the XML section of a file.

    Raises
    ------
    FormatError
        A file that is cut short or damaged.
    """
    _, start, length = _layout(path, file)
    return _payload(path, file, start, length)


def write_with_xml(path: Path, file: BinaryIO, handle: BinaryIO, xml: bytes) -> None:
    """Copy a file with another XML section; the binary sections keep every byte.

    Only the XML section, the header, and the checksums of their pages change. If other sections
    follow the XML section, the new one is appended, and the old one is unused.

    Raises
    ------
    FormatError
        A file that is cut short or damaged.
    """
    pages, start, length = _layout(path, file)
    if (start + length - 1) // _PAYLOAD != pages - 1:
        start = pages * _PAYLOAD
    first = start // _PAYLOAD
    tail = _payload(path, file, first * _PAYLOAD, start % _PAYLOAD) + xml
    count = -(-len(tail) // _PAYLOAD)
    file.seek(0)
    signature, major, minor, *_ = HEADER.unpack(file.read(HEADER.size))
    size, offset = (first + count) * PAGE_SIZE, first * PAGE_SIZE + start % _PAYLOAD
    header = HEADER.pack(signature, major, minor, size, offset, len(xml), PAGE_SIZE)
    if first == 0:
        tail = header + tail[HEADER.size :]
    else:
        rest = _payload(path, file, HEADER.size, _PAYLOAD - HEADER.size)
        handle.write(sealed(header + rest))
        file.seek(PAGE_SIZE)
        _copy(file, handle, (first - 1) * PAGE_SIZE)
    tail = tail.ljust(count * _PAYLOAD, b" ")
    for k in range(count):
        handle.write(sealed(tail[k * _PAYLOAD : (k + 1) * _PAYLOAD]))


def sealed(payload: bytes) -> bytes:
    """Return a page: the payload and its CRC-32C, big-endian."""
    crc = 0xFFFFFFFF
    for byte in payload:
        crc = _TABLE[(crc ^ byte) & 0xFF] ^ (crc >> 8)
    return payload + (crc ^ 0xFFFFFFFF).to_bytes(4, "big")


def _layout(path: Path, file: BinaryIO) -> tuple[int, int, int]:
    """Return the number of pages, and the logical start and the length of the XML section."""
    file.seek(0)
    size, offset, length = read_header(path, file.read(HEADER.size))
    found = path.stat().st_size
    if size != found:
        raise malformed(
            path, "header", expected=f"a file of {size} bytes", found=str(found), remedy=REMEDY
        )
    return size // PAGE_SIZE, offset // PAGE_SIZE * _PAYLOAD + offset % PAGE_SIZE, length


def _payload(path: Path, file: BinaryIO, start: int, length: int) -> bytes:
    """Return bytes of the logical contents, after a check of their checksums."""
    first, last = start // _PAYLOAD, -(-(start + length) // _PAYLOAD)
    file.seek(first * PAGE_SIZE)
    parts: list[bytes] = []
    for number in range(first, last):
        page = file.read(PAGE_SIZE)
        if len(page) < PAGE_SIZE or sealed(page[:_PAYLOAD]) != page:
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


def _copy(file: BinaryIO, handle: BinaryIO, size: int) -> None:
    while size > 0:
        part = file.read(min(size, _COPIED))
        handle.write(part)
        size -= len(part) or size


def _crc_of_byte(value: int) -> int:
    for _ in range(8):
        value = (value >> 1) ^ (_POLYNOMIAL if value & 1 else 0)
    return value


_TABLE = tuple(_crc_of_byte(value) for value in range(256))
