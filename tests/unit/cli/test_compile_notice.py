import sys

import numba
import pytest

from scanlock.cli.compile_notice import compile_watch

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
