"""Error messages for malformed files: location, expected and found content, remedy."""

import errno
from pathlib import Path

from scanlock.errors import FormatError


def malformed(path: Path, where: str, *, expected: str, found: str, remedy: str) -> FormatError:
    """Return the error for a file that does not follow its format.

    Parameters
    ----------
    path : Path
        The file.
    where : str
        Location in the file: ``"line 12"``, ``"byte 4096"`` or ``"header"``.
    expected, found : str
        Content that the format requires, and the actual content.
    remedy : str
        Advice to the user.
    """
    return FormatError(f"{path}: {where}: expected {expected}, found {found}; {remedy}")


def read_bytes(path: Path, kind: str) -> bytes:
    """Read the bytes of a file.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Name of its content in messages: ``"scan"``, ``"pose"``, ``"label"``.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        The path is a folder, or the file is empty.
    """
    if not path.exists():
        raise FileNotFoundError(
            errno.ENOENT, f"no such {kind} file (looked in {path.resolve().parent})", str(path)
        )
    if path.is_dir():
        raise FormatError(
            f"{path}: expected a {kind} file, found a folder; give one of the files inside it"
        )
    data = path.read_bytes()
    if not data:
        raise malformed(
            path,
            "byte 0",
            expected=f"a {kind} file",
            found="an empty file",
            remedy="write or copy it again",
        )
    return data


def check_body_size(path: Path, data: bytes, offset: int, expected: int) -> None:
    """Raise `FormatError` unless `expected` bytes follow from `offset` on.

    Trailing zeros and white space are accepted: some writers pad to a page or end the line.
    """
    found = len(data) - offset
    if found < expected or data[offset + expected :].strip(b"\0 \t\r\n"):
        raise malformed(
            path,
            f"byte {min(offset + expected, len(data))}",
            expected=f"{expected} bytes of data from byte {offset} on",
            found=f"{found}",
            remedy="the file is cut short, or its header is wrong; copy or write it again",
        )
