import gc
import multiprocessing
import signal
import threading
from types import SimpleNamespace

import numba
import pytest

from scanlock.registration import compile_ahead
from scanlock.registration.compile_ahead import (
    KernelSignature,
    compile_in_parallel,
    compile_next,
    missing_kernels,
)


class FakeKernel:
    def __init__(self, log, name, module=None):
        self._log, self._name = log, name
        self.module = name if module is None else module

    def compile(self):
        self._log.append(self._name)


class Counts(list):
    """Two numbers with a lock, as an array of `multiprocessing` has."""

    def __init__(self):
        super().__init__([0, 0])
        self._lock = threading.Lock()

    def get_lock(self):
        return self._lock


def test_each_kernel_is_compiled_by_one_process_and_reported():
    log, reports, counts = [], [], Counts()
    kernels = [FakeKernel(log, k) for k in range(50)]
    threads = [
        threading.Thread(
            target=compile_next, args=(kernels, counts, lambda *numbers: reports.append(numbers))
        )
        for _ in range(4)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(log) == list(range(50))
    assert len(reports) == 50
    assert max(reports) == (50, 50)


def test_kernels_of_a_module_are_compiled_together_and_without_garbage_collection():
    log = []
    kernels = [FakeKernel(log, k, module=k % 3) for k in range(7)]
    kernels[4].compile = lambda: log.append(gc.isenabled())
    compile_next(kernels, Counts())
    assert log == [0, 3, 6, 1, False, 2, 5]
    assert gc.isenabled()


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_the_table_names_kernels_and_their_types(monkeypatch):
    monkeypatch.setattr(KernelSignature, "is_compiled", lambda self: False)
    every, default = (missing_kernels(default_only=only) for only in (False, True))
    assert 30 < len(default) < len(every)
    assert default == every[: len(default)]
    for kernel in every:
        assert isinstance(kernel.dispatcher(), numba.core.dispatcher.Dispatcher)
        assert tuple(map(repr, kernel.types())) == kernel.arguments


def test_types_of_older_versions_are_found(monkeypatch):
    monkeypatch.delattr(numba.types, "bool", raising=False)
    kernel = KernelSignature(name="a.b", arguments=("bool",), is_default=True)
    assert kernel.types() == (numba.types.boolean,)


def test_only_the_first_process_receives_the_interrupt_of_a_terminal(monkeypatch):
    handlers = []

    class Helper:
        def __init__(self, **_):
            pass

        def start(self):
            handlers.append(signal.getsignal(signal.SIGINT))

        def join(self):
            handlers.append(signal.getsignal(signal.SIGINT))

    context = SimpleNamespace(Array=lambda *_: Counts(), Process=Helper)
    monkeypatch.setattr(multiprocessing, "get_context", lambda _: context)
    log = []
    compile_in_parallel([FakeKernel(log, k) for k in range(3)], 2)
    assert handlers == [signal.SIG_IGN, signal.default_int_handler]
    assert log == [0, 1, 2]


def test_one_kernel_needs_no_further_process(monkeypatch):
    context = SimpleNamespace(Array=lambda *_: Counts())
    monkeypatch.setattr(multiprocessing, "get_context", lambda _: context)
    log = []
    compile_in_parallel([FakeKernel(log, 0)], 8)
    assert log == [0]


def test_a_kernel_without_a_cache_is_not_missing(monkeypatch):
    monkeypatch.setattr(KernelSignature, "dispatcher", lambda self: lambda: None)
    kernel = KernelSignature(name="a.b", arguments=("int64",), is_default=True)
    assert kernel.is_compiled()
    assert compile_ahead.TABLE.is_file()
