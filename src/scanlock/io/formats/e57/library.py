"""Access to pye57, the names of the fields, and the checks before a file is opened."""

import importlib
import struct
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from scanlock.errors import FormatError, MissingExtra, ScanlockError
from scanlock.io.errors import malformed

SIGNATURE = b"ASTM-E57"
HEADER = struct.Struct("<8sIIQQQQ")
"""Signature, version (2), size of the file, offset and size of the XML section, size of a page."""

PAGE_SIZE = 1024
"""Size of a page [bytes], the last 4 of which are a checksum of the others."""

REMEDY = "the file is cut short or damaged; copy or export it again"

NAMES = {
    "colorRed": "red",
    "colorGreen": "green",
    "colorBlue": "blue",
    "rowIndex": "row",
    "columnIndex": "column",
    "timeStamp": "time",
    "nor:normalX": "nx",
    "nor:normalY": "ny",
    "nor:normalZ": "nz",
}
"""Our name of each field of E57 that has another one there."""

NORMALS = "nor", "http://www.libe57.org/E57_NOR_surface_normals.txt"
"""Prefix and identifier of the extension for normals."""

FIELDS = "field", "urn:scanlock:e57-fields"
"""Prefix and identifier of the extension for fields that E57 does not define."""

INVALID = "invalid"
"""Name of the field of invalid points: 0 valid, 1 without a distance, 2 without a direction."""


def libe57(path: Path) -> Any:
    """Return the bindings of libE57Format.

    Raises
    ------
    MissingExtra
        pye57 is not installed.
    """
    try:
        return importlib.import_module("pye57.libe57")
    except ModuleNotFoundError as error:
        raise MissingExtra(
            f'{path}: E57 needs pye57: pip install "scanlock[e57]"; or export .ptx or .las'
        ) from error


@contextmanager
def opened(library: Any, path: Path) -> Generator[Any]:
    """Open a file to read, and turn the errors of the library into `FormatError`.

    Raises
    ------
    FormatError
        A file that is cut short or damaged.
    """
    _check_header(path)
    file: Any = None
    try:
        file = library.ImageFile(str(path), "r")
        yield file
    except ScanlockError:
        raise
    # The library raises its own error for each fault of a file, and NumPy and Python theirs for
    # contents that they cannot represent.
    except (
        library.E57Exception, ArithmeticError, LookupError, MemoryError, RuntimeError, TypeError,
        ValueError,
    ) as error:  # fmt: skip
        text = " ".join(str(error).split())[:160]
        raise FormatError(
            f"{path}: expected scans of E57, found data that libE57 cannot read ({text}); {REMEDY}"
        ) from error
    finally:
        if file is not None:
            file.close()


def buffer_type(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of the array from and to which the library copies a column.

    Integers of 4 and 8 bytes are of the C type long long: the only long one it copies rightly.
    """
    is_unsupported = dtype.kind in "iu" and dtype.itemsize >= 4
    return np.dtype(np.longlong) if is_unsupported else dtype


def read_header(path: Path, data: bytes) -> tuple[int, int, int]:
    """Return the size of the file and the physical offset and size of the XML section [bytes].

    Raises
    ------
    FormatError
        A header that does not follow the format.
    """
    if len(data) < HEADER.size or not data.startswith(SIGNATURE):
        raise malformed(
            path,
            "byte 0",
            expected=f"{SIGNATURE.decode()} and a header of {HEADER.size} bytes",
            found=f"{data[:8]!r} and {len(data)} bytes",
            remedy=REMEDY,
        )
    _, major, _, size, offset, length, page = HEADER.unpack_from(data)
    if major != 1 or page != PAGE_SIZE or size % PAGE_SIZE or not HEADER.size <= offset < size:
        raise malformed(
            path,
            "header",
            expected=f"E57 of version 1 in pages of {PAGE_SIZE} bytes",
            found=f"version {major}, pages of {page} bytes, {size} bytes",
            remedy=REMEDY,
        )
    return size, offset, length


def _check_header(path: Path) -> None:
    with path.open("rb") as file:
        size = read_header(path, file.read(HEADER.size))[0]
    found = path.stat().st_size
    if size != found:
        raise malformed(
            path, "header", expected=f"a file of {size} bytes", found=str(found), remedy=REMEDY
        )
