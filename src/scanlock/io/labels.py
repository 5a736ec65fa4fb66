"""Labels of points as files: .npy, text, and SemanticKITTI's .label."""

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Labels
from scanlock.errors import FormatError, InvalidInput
from scanlock.io.atomic import atomic_file
from scanlock.io.errors import malformed, read_bytes
from scanlock.io.formats.npy import array_from_npy
from scanlock.io.numeric_text import (
    SEPARATORS,
    first_line,
    is_numeric_line,
    parse_rows,
    without_comments,
)

_EXTENSIONS = (".npy", ".txt", ".csv", ".label")
_LARGEST_UINT32 = 2**32 - 1


def read_labels(path: str | os.PathLike[str], count: int | None = None) -> Labels:
    """Return the (n,) labels in a file, one for each row of its scan.

    Parameters
    ----------
    path : path-like
        ``.npy`` of whole numbers; ``.txt`` or ``.csv`` with one a line, under a line of text or
        not; ``.label`` of uint32, of which SemanticKITTI keeps the class in the lower 16 bits
        (``labels & 0xFFFF``) and the instance in the upper 16 (``labels >> 16``).
    count : int, optional
        Rows of the scan; another number of labels is an error. A cut .label or text file can
        only be told by this.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        The file holds something else, or another number of labels than `count`.
    InvalidInput
        The ending of the name is none of those above.
    """
    path = Path(path)
    suffix = _require_extension(path)
    data = read_bytes(path, "label")
    if suffix == ".npy":
        labels = _from_npy(path, data)
    elif suffix == ".label":
        labels = _from_uint32(path, data)
    else:
        labels = _from_text(path, data)
    if count is not None and len(labels) != count:
        raise malformed(
            path,
            "data",
            expected=f"{count} labels, one a row of the scan",
            found=str(len(labels)),
            remedy="it belongs to another scan, or is cut short",
        )
    return labels


def write_labels(path: str | os.PathLike[str], labels: ArrayLike) -> None:
    """Write (n,) whole numbers (or a mask) as the ending of the name says; see `read_labels`.

    Raises
    ------
    InvalidInput
        Anything but (n,) whole numbers, an unknown ending, or values that .label (uint32) cannot
        hold.
    """
    path = Path(path)
    suffix = _require_extension(path)
    values = np.asarray(labels)
    if values.ndim != 1 or values.dtype.kind not in "biu" or len(values) == 0:
        raise InvalidInput(
            f"labels must be whole numbers of shape (n,), got {values.dtype} {values.shape}"
        )
    low, high = int(values.min()), int(values.max())
    if suffix == ".label" and (low < 0 or high > _LARGEST_UINT32):
        raise InvalidInput(
            f"labels must lie between 0 and {_LARGEST_UINT32} in a .label file, got {low} to "
            f"{high}; add 1 to keep -1 (left out), or write .npy"
        )
    if high > np.iinfo(np.int64).max:
        raise InvalidInput(f"labels must fit 64-bit signed integers, got {high}")
    values = values.astype(np.int64)
    with atomic_file(path) as handle:
        if suffix == ".npy":
            np.lib.format.write_array(handle, values, allow_pickle=False)
        elif suffix == ".label":
            handle.write(values.astype("<u4").tobytes())
        else:
            head = "label\n" if suffix == ".csv" else ""
            handle.write((head + "\n".join(map(str, values.tolist())) + "\n").encode("ascii"))


def _require_extension(path: Path) -> str:
    suffix = path.suffix.lower()
    if suffix not in _EXTENSIONS:
        raise InvalidInput(
            f"a label file must end in {', '.join(_EXTENSIONS)}, got {path.name!r}; rename it"
        )
    return suffix


def _from_npy(path: Path, data: bytes) -> Labels:
    array = array_from_npy(path, data)
    if array.ndim != 1 or array.dtype.kind not in "biu" or len(array) == 0:
        raise _no_labels(path, f"{array.dtype} of shape {array.shape}")
    return array.astype(np.int64)


def _from_uint32(path: Path, data: bytes) -> Labels:
    if len(data) % 4:
        raise malformed(
            path,
            f"byte {len(data) - len(data) % 4}",
            expected="whole uint32 values (4 bytes each)",
            found=f"{len(data) % 4} bytes left over",
            remedy="the file is cut short or holds something else",
        )
    return np.frombuffer(data, dtype="<u4").astype(np.int64)


def _from_text(path: Path, data: bytes) -> Labels:
    body = without_comments(data)
    start, end = first_line(body)
    if not is_numeric_line(body[start:end]):
        body = body[:start] + body[end:]
    columns = parse_rows(path, body.translate(SEPARATORS), width=1)
    if not columns or columns[0].dtype.kind not in "iu":
        raise _no_labels(path, "numbers with fractions" if columns else "none")
    return columns[0].astype(np.int64)


def _no_labels(path: Path, found: str) -> FormatError:
    return malformed(
        path,
        "data",
        expected="one whole number a point",
        found=found,
        remedy="check that it is a label file",
    )
