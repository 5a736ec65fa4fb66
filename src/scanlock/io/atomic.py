"""Files that are either the old one or the whole new one, never half of it."""

import errno
import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Generator[BinaryIO, None, None]:
    """Open a binary file beside `path` that replaces it once the block ends without an error.

    On an error the temporary file is removed and whatever stood at `path` stays untouched. A
    symbolic link is followed, and the mode of a replaced file is kept.

    Raises
    ------
    FileNotFoundError
        The folder to write into does not exist.
    """
    final = Path(os.path.realpath(path))
    if not final.parent.is_dir():
        raise FileNotFoundError(
            errno.ENOENT, "the folder to write into does not exist; create it", str(final.parent)
        )
    if final.is_dir():
        raise IsADirectoryError(errno.EISDIR, "a folder stands where the file would go", str(path))
    temporary = final.with_name(f".{final.name}.{secrets.token_hex(4)}.part")
    # Opened by number so that the user's umask gives the new file its ordinary mode.
    descriptor = os.open(
        temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666
    )
    try:
        with os.fdopen(descriptor, "wb") as handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        if final.exists():
            shutil.copymode(final, temporary)
        os.replace(temporary, final)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
