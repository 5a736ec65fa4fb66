"""Compilation of kernels in parallel by the command line, with a notice at a terminal."""

import sys
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scanlock.registration.compile_ahead import KernelSignature


class CompileWatch:
    """Detects that a kernel is compiled rather than loaded from disk.

    The first time, it compiles all missing kernels in one process for each core, and shows their
    number at a terminal.

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
            sys.stderr.write("compiling for the first use; later runs start at once\n")
        self.compiled = True

    def compile_missing(self, kernels: "Sequence[KernelSignature]") -> None:
        """Compile kernels in parallel."""
        from scanlock.pipelines.many.workers import core_count
        from scanlock.registration.compile_ahead import compile_in_parallel

        self.compiled = True
        self.show(0, len(kernels))
        compile_in_parallel(kernels, core_count(), self.show)
        if sys.stderr.isatty():
            sys.stderr.write("\n")

    def show(self, done: int, total: int) -> None:
        """Show the number of compiled kernels at a terminal."""
        if sys.stderr.isatty():
            # Written over itself; a running spinner moves it to the line above its own.
            sys.stderr.write(
                f"\rcompiling {total} kernels for this machine, once: {done} of {total}"
            )
            sys.stderr.flush()


@contextmanager
def compile_watch(
    missing: "Callable[[], Sequence[KernelSignature]] | None" = None,
) -> Generator[CompileWatch]:
    """Compile in parallel during the ``with`` block, with a notice on stderr at a terminal.

    Parameters
    ----------
    missing : callable, optional
        Returns the kernels to compile when the first is missing; by default those of a
        registration by the default method.
    """
    from numba.core import event

    from scanlock.kernels._compile import NOTICE
    from scanlock.registration.compile_ahead import missing_kernels

    watch = CompileWatch()

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            watch.on_start(event)

        def on_end(self, event: Any) -> None:
            pass

    def ahead() -> None:
        find = missing or (lambda: missing_kernels(default_only=True))
        watch.compile_missing(find())

    NOTICE.ahead = ahead
    try:
        with event.install_listener("numba:compile", Listener()):
            yield watch
    finally:
        NOTICE.ahead = None
