import sys

import numba
import pytest

from scanlock.cli.compile_notice import compile_watch

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="there is no compiler to watch")


def _fresh():
    @numba.njit
    def twice(a):
        return 2 * a

    return twice


def test_a_compilation_is_noticed_and_outside_of_a_terminal_not_told(capsys):
    twice = _fresh()
    with compile_watch() as watch:
        assert not watch.compiled
        assert twice(2) == 4
    assert watch.compiled
    assert capsys.readouterr() == ("", "")


def test_without_a_compilation_there_is_nothing_to_notice():
    twice = _fresh()
    twice(2)
    with compile_watch() as watch:
        twice(3)
    assert not watch.compiled


@pytest.mark.parametrize("kernels", [1, 3])
def test_at_a_terminal_it_is_told_once_and_on_stderr(monkeypatch, capsys, kernels):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with compile_watch():
        for _ in range(kernels):
            _fresh()(2)
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("compiling for the first use") == 1
