"""Whether kernels are being compiled, and the notice for those who wait at a terminal."""

import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any


class CompileWatch:
    """Notices that a kernel is compiled rather than found on disk, and says so once.

    Attributes
    ----------
    compiled : bool
        Whether it has happened.
    """

    def __init__(self) -> None:
        self.compiled = False

    def on_start(self, event: Any) -> None:
        """Take note of a compilation that begins."""
        if not self.compiled and sys.stderr.isatty():
            # Not by a console of its own: a spinner, if one turns, hands this on to the line
            # above its own.
            sys.stderr.write(
                "compiling for the first use, for up to half a minute; later runs start at once\n"
            )
        self.compiled = True


@contextmanager
def compile_watch() -> Generator[CompileWatch]:
    """Watch for compilation inside the ``with`` block; on a terminal, stderr tells of it."""
    from numba.core import event

    watch = CompileWatch()

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            watch.on_start(event)

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield watch
