"""Files of point labels: .npy, text, and .label of SemanticKITTI."""

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
_MAX_UINT32 = 2**32 - 1


def read_labels(path: str | os.PathLike[str], count: int | None = None) -> Labels:
    """Read the labels of a scan from a file, in the order of its rows.

    Parameters
    ----------
    path : path-like
        ``.npy`` of whole numbers; ``.txt`` or ``.csv`` with one number per line, optionally below
        a heading; ``.label`` of uint32. SemanticKITTI stores the class in the lower 16 bits
        (``labels & 0xFFFF``) and the instance in the upper 16 (``labels >> 16``).
    count : int, optional
        Number of rows of the scan. Only with it can a truncated .label or text file be detected.

    Returns
    -------
    (n,) of int64

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        Other content, or another number of labels than `count`.
    InvalidInput
        An unknown extension.
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
            expected=f"{count} labels, one for each row of the scan",
            found=str(len(labels)),
            remedy="the file belongs to another scan, or is cut short",
        )
    return labels


def write_labels(path: str | os.PathLike[str], labels: ArrayLike) -> None:
    """Write labels to a file in the format of its extension; see `read_labels`.

    Parameters
    ----------
    path : path-like
    labels : (n,)
        Whole numbers or a mask.

    Raises
    ------
    InvalidInput
        Labels of another shape or type, an unknown extension, or values beyond the uint32 of
        .label.
    """
    path = Path(path)
    suffix = _require_extension(path)
    values = np.asarray(labels)
    if values.ndim != 1 or values.dtype.kind not in "biu" or len(values) == 0:
        raise InvalidInput(
            f"labels must be whole numbers of shape (n,), got {values.dtype} {values.shape}"
        )
    low, high = int(values.min()), int(values.max())
    if suffix == ".label" and (low < 0 or high > _MAX_UINT32):
        raise InvalidInput(
            f"labels must be between 0 and {_MAX_UINT32} in a .label file, got {low} to {high}; "
            "add 1 if -1 marks points without a label, or write .npy"
        )
    if high > np.iinfo(np.int64).max:
        raise InvalidInput(f"labels must fit into signed 64-bit integers, got {high}")
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
            f"the extension of a label file must be one of {', '.join(_EXTENSIONS)}, got "
            f"{path.name!r}; rename it"
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
            remedy="the file is cut short or has another format",
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
        expected="one whole number per point",
        found=found,
        remedy="check that it is a label file",
    )
