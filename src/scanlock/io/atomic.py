"""Atomic replacement of files: readers find the old file or the complete new one."""

import errno
import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_MAX_NAME = 50
"""Characters of a file name, of up to four bytes each, in the name of its temporary file."""


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Generator[BinaryIO, None, None]:
    """Open a temporary binary file that replaces `path` when the block ends without an error.

    On an error or an interrupt, the temporary file is removed and `path` is unchanged. If several
    writers replace one file at once, the last to end wins. Symbolic links are followed, and the
    mode of a replaced file is kept.

    Parameters
    ----------
    path : path-like

    Yields
    ------
    BinaryIO
        The temporary file, in the folder of `path`.

    Raises
    ------
    FileNotFoundError
        The folder does not exist.
    IsADirectoryError
        The path is a folder.
    """
    final = Path(os.path.realpath(path))
    if not final.parent.is_dir():
        raise FileNotFoundError(
            errno.ENOENT, "the folder to write into does not exist; create it", str(final.parent)
        )
    if final.is_dir():
        raise IsADirectoryError(
            errno.EISDIR, "the path to write is a folder; give a file name", str(path)
        )
    # Shortened, since the name may already be as long as the file system allows. The random part
    # is long enough to be unique over all writers and processes.
    temporary = final.with_name(f".{final.name[:_MAX_NAME]}.{secrets.token_hex(8)}.part")
    try:
        # Opened by descriptor so that the umask determines the mode of the new file.
        descriptor = os.open(
            temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0), 0o666
        )
        with os.fdopen(descriptor, "wb") as handle:
            yield handle
            handle.flush()
            os.fsync(handle.fileno())
        with suppress(FileNotFoundError):
            shutil.copymode(final, temporary)
        os.replace(temporary, final)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
