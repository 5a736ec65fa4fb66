"""Compilation of kernels by their signatures, in several processes, before they are called.

``kernels.json`` lists every kernel that Python calls, with the types of its arguments, the slowest
first. It is written by ``python -m benchmarks.speed.kernel_table``. A kernel that it lacks is
compiled on its first call.
"""

import gc
import importlib
import json
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numba import types

from scanlock.interrupts import children_ignore_interrupts

TABLE = Path(__file__).with_name("kernels.json")
"""The table of kernels."""

Report = Callable[[int, int], None]
"""Called with the number of kernels that are compiled and of all, after each kernel."""


@dataclass(frozen=True, kw_only=True, slots=True)
class KernelSignature:
    """A kernel with the types of its arguments."""

    name: str
    """Module below `scanlock.kernels`, and function."""

    arguments: tuple[str, ...]
    """Numba types of the arguments."""

    is_default: bool
    """Whether a registration by the default method calls it."""

    @property
    def module(self) -> str:
        """Module of the kernel below `scanlock.kernels`."""
        return self.name.rpartition(".")[0]

    def dispatcher(self) -> Any:
        """Return the kernel."""
        function = self.name.rpartition(".")[2]
        return getattr(importlib.import_module(f"scanlock.kernels.{self.module}"), function)

    def types(self) -> tuple[Any, ...]:
        """Return the types of the arguments."""
        # The names of Numba's types are expressions in its module of types, in which older versions
        # have no bool.
        names = {"bool": types.boolean, **vars(types)}
        return tuple(eval(text, {"__builtins__": {}}, names) for text in self.arguments)

    def is_compiled(self) -> bool:
        """Return whether the machine code is on disk; True without a compiler or a cache."""
        kernel = self.dispatcher()
        cache = getattr(kernel, "_cache", None)
        return cache is None or cache.has(self.types(), kernel.targetctx)

    def compile(self) -> None:
        """Compile the kernel, or load it from disk."""
        self.dispatcher().compile(self.types())


def missing_kernels(*, default_only: bool) -> list[KernelSignature]:
    """Return the kernels of the table that are not compiled on this machine, slowest first."""
    rows = json.loads(TABLE.read_text(encoding="utf-8"))
    kernels = [
        KernelSignature(name=name, arguments=tuple(arguments), is_default=is_default)
        for name, arguments, is_default in rows
    ]
    return [one for one in kernels if one.is_default or not default_only if not one.is_compiled()]


def compile_in_parallel(
    kernels: Sequence[KernelSignature], processes: int, report: Report | None = None
) -> None:
    """Compile kernels in this process and in new ones, which share the cache on disk.

    Each process takes the kernels of the next module when it has compiled those of one: kernels of
    a module share helpers, which each process compiles for itself.

    Parameters
    ----------
    kernels : sequence of KernelSignature
        As from `missing_kernels`.
    processes : int
        Number of processes, this one included.
    report : callable, optional
        Called in this process.
    """
    from multiprocessing import get_context

    # Spawned, since a forked process would inherit the locks of the compiler.
    context = get_context("spawn")
    counts = context.Array("i", 2)
    helpers = [
        context.Process(target=compile_next, args=(list(kernels), counts), daemon=True)
        for _ in range(min(processes, len(kernels)) - 1)
    ]
    with children_ignore_interrupts():
        for helper in helpers:
            helper.start()
    compile_next(kernels, counts, report)
    for helper in helpers:
        helper.join()


def compile_next(
    kernels: Sequence[KernelSignature], counts: Any, report: Report | None = None
) -> None:
    """Compile kernels of modules that no other process has taken, until none is left.

    Parameters
    ----------
    kernels : sequence of KernelSignature
    counts : array of two integers, shared
        Numbers of modules that are taken and of kernels that are compiled.
    report : callable, optional
    """
    modules: dict[str, list[KernelSignature]] = {}
    for one in kernels:
        modules.setdefault(one.module, []).append(one)
    with _no_garbage_collection():
        while True:
            with counts.get_lock():
                number = counts[0]
                counts[0] += 1
            if number >= len(modules):
                return
            for one in [*modules.values()][number]:
                one.compile()
                with counts.get_lock():
                    counts[1] += 1
                if report is not None:
                    report(counts[1], len(kernels))


@contextmanager
def _no_garbage_collection() -> Generator[None, None, None]:
    """Collect no garbage meanwhile, which takes a tenth of the time of compiling.

    Almost all objects of the compiler stay in use, so little memory is lost.
    """
    was_enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_enabled:
            gc.enable()
