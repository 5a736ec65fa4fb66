"""One sentence for every broken file: where, what was expected, what was found, what to do."""

import errno
from pathlib import Path

from scanlock.errors import FormatError


def malformed(path: Path, where: str, *, expected: str, found: str, remedy: str) -> FormatError:
    """Return the error for a file that breaks its format.

    Parameters
    ----------
    path : Path
        The file.
    where : str
        ``"line 12"``, ``"byte 4096"`` or ``"header"``.
    expected, found : str
        What the format asks for, and what stands there.
    remedy : str
        What the reader of the message can do about it.
    """
    return FormatError(f"{path}: {where}: expected {expected}, found {found}; {remedy}")


def read_bytes(path: Path, kind: str) -> bytes:
    """Return a file's bytes; `kind` ("scan", "pose", "label") says what was looked for.

    Raises
    ------
    FileNotFoundError
        There is no such file.
    FormatError
        It is a folder, or has no bytes.
    """
    if not path.exists():
        raise FileNotFoundError(
            errno.ENOENT, f"no such {kind} file (looked in {path.resolve().parent})", str(path)
        )
    if path.is_dir():
        raise FormatError(
            f"{path}: expected a {kind} file, found a folder; name one of the files inside it"
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
    """Raise `FormatError` unless the bytes from `offset` on are the `expected` number.

    Zeros and white space after them are forgiven: some writers pad to a page or end the line.
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
