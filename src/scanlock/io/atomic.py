"""Files that are either the old one or the whole new one, never half of it."""

import errno
import os
import secrets
import shutil
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

_NAME = 50
"""Letters of a file's name in that of its temporary file, of up to four bytes each."""


@contextmanager
def atomic_file(path: str | os.PathLike[str]) -> Generator[BinaryIO, None, None]:
    """Open a binary file beside `path` that replaces it once the block ends without an error.

    On an error or an interrupt, wherever it strikes, the temporary file is removed and whatever
    stood at `path` stays untouched. Of several that write one file at once, the last to end
    leaves its own. A symbolic link is followed, and the mode of a replaced file is kept.

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
    # Cut short, since a name may be as long as the file system takes. What is drawn at random is
    # long enough for no two writers ever to draw the same, in one process or in several.
    temporary = final.with_name(f".{final.name[:_NAME]}.{secrets.token_hex(8)}.part")
    try:
        # Opened by number so that the user's umask gives the new file its ordinary mode.
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
