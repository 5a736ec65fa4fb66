"""Error messages for malformed files: location, expected and found content, remedy."""

import errno
import os
import stat
from pathlib import Path

from scanlock.errors import FormatError

START_SIZE = 65536
"""Number of bytes in which the format of a file shows."""

_LARGE_FILE = 1 << 26
"""Size [bytes] from which on the free memory is compared; asking for it takes a millisecond."""

_SPECIAL_FILES = (
    (stat.S_ISCHR, "a character device"),
    (stat.S_ISBLK, "a block device"),
    (stat.S_ISFIFO, "a pipe"),
    (stat.S_ISSOCK, "a socket"),
)
"""Test of the file mode, and name, of everything that is neither a file nor a folder."""


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
        As for `require_regular_file`.
    """
    require_regular_file(path, kind)
    return path.read_bytes()


def read_start(path: Path, kind: str) -> bytes:
    """Read the first bytes of a file, enough to detect its format.

    Raises
    ------
    FileNotFoundError, FormatError
        As for `require_regular_file`.
    """
    require_regular_file(path, kind)
    with path.open("rb") as file:
        return file.read(START_SIZE)


def require_regular_file(path: Path, kind: str) -> None:
    """Raise unless the path is a file that has contents and fits into the memory.

    Pipes and devices may have no end, so nothing is read from them.

    Parameters
    ----------
    path : Path
        The file.
    kind : str
        Name of its content in messages.

    Raises
    ------
    FileNotFoundError
        The file does not exist.
    FormatError
        A folder, a device, a pipe or a socket, an empty file, or one above the free memory.
    """
    try:
        status = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        raise FileNotFoundError(
            errno.ENOENT, f"no such {kind} file (looked in {path.resolve().parent})", str(path)
        ) from None
    if stat.S_ISDIR(status.st_mode):
        raise FormatError(
            f"{path}: expected a {kind} file, found a folder; give one of the files inside it"
        )
    special = next((title for test, title in _SPECIAL_FILES if test(status.st_mode)), None)
    if special is not None:
        raise FormatError(
            f"{path}: expected a {kind} file, found {special}, which has no size and may have no "
            "end; write its contents to a file first"
        )
    if status.st_size == 0:
        raise malformed(
            path,
            "byte 0",
            expected=f"a {kind} file",
            found="an empty file",
            remedy="write or copy it again",
        )
    free = free_memory() if status.st_size > _LARGE_FILE else None
    if free is not None and status.st_size > free:
        raise FormatError(
            f"{path}: expected a {kind} file of at most {free / 1e9:.1f} GB, the free memory, "
            f"found one of {status.st_size / 1e9:.1f} GB; split it with another tool"
        )


def free_memory() -> int | None:
    """Return the memory that can be allocated without swapping [bytes]; None if unknown."""
    try:
        with open("/proc/meminfo", encoding="ascii") as lines:
            return 1024 * next(int(line.split()[1]) for line in lines if "MemAvailable" in line)
    except (OSError, StopIteration):
        pass
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, ValueError, OSError):
        return None


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
