import sys

import numba
import pytest

from scanlock.cli.compile_notice import compile_watch
from scanlock.kernels._compile import NOTICE

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")


def _new_kernel():
    @numba.njit
    def twice(a):
        return 2 * a

    return twice


def test_a_compilation_is_detected_and_not_printed_without_a_terminal(capsys):
    twice = _new_kernel()
    with compile_watch() as watch:
        assert not watch.compiled
        assert twice(2) == 4
    assert watch.compiled
    assert capsys.readouterr() == ("", "")


def test_cached_calls_are_not_detected_as_a_compilation():
    twice = _new_kernel()
    twice(2)
    with compile_watch() as watch:
        twice(3)
    assert not watch.compiled


@pytest.mark.parametrize("kernels", [1, 3])
def test_the_notice_is_printed_once_to_stderr_of_a_terminal(monkeypatch, capsys, kernels):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with compile_watch():
        for _ in range(kernels):
            _new_kernel()(2)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("compiling for the first use") == 1


def test_the_number_of_kernels_is_shown_at_a_terminal(monkeypatch, capsys):
    def compile_both(kernels, processes, report):
        assert (kernels, processes > 0) == (["one", "two"], True)
        report(1, 2)
        report(2, 2)

    monkeypatch.setattr("scanlock.registration.compile_ahead.compile_in_parallel", compile_both)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with compile_watch(missing=lambda: ["one", "two"]) as watch:
        assert NOTICE.give("folder")
        assert not NOTICE.give("folder")
        _new_kernel()(2)
    assert watch.compiled
    texts = [f"compiling 2 kernels for this machine, once: {done} of 2" for done in range(3)]
    assert capsys.readouterr().err == "".join(f"\r{text}" for text in texts) + "\n"
    assert NOTICE.ahead is None
