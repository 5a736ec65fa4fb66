"""Detection of kernel compilation, with a notice at a terminal."""

import sys
from collections.abc import Generator
from contextlib import contextmanager
from typing import Any


class CompileWatch:
    """Detects that a kernel is compiled rather than loaded from disk, and prints a notice once.

    Attributes
    ----------
    compiled : bool
        Whether a kernel was compiled.
    """

    def __init__(self) -> None:
        self.compiled = False

    def on_start(self, event: Any) -> None:
        """Record the start of a compilation."""
        if not self.compiled and sys.stderr.isatty():
            # Written directly: a running spinner moves this to the line above its own.
            sys.stderr.write(
                "compiling for the first use, for up to half a minute; later runs start at once\n"
            )
        self.compiled = True


@contextmanager
def compile_watch() -> Generator[CompileWatch]:
    """Detect compilation during the ``with`` block, with a notice on stderr at a terminal."""
    from numba.core import event

    watch = CompileWatch()

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            watch.on_start(event)

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Listener()):
        yield watch
