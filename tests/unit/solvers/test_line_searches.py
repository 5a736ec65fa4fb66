"""The rules of three line searches, on the functions of More and Thuente 1994, section 5."""

import math

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.solvers.line_search import Armijo, StrongWolfe
from scanlock.solvers.more_thuente import MoreThuente

_SEARCHES = [Armijo(), StrongWolfe(), MoreThuente()]
_WOLFE = [
    rule(flatness=flatness, longest=1e5)
    for rule in (StrongWolfe, MoreThuente)
    for flatness in (0.1, 0.9)
]


def _first(a, beta=2.0):
    return -a / (a**2 + beta), (a**2 - beta) / (a**2 + beta) ** 2


def _second(a, beta=0.004):
    return (a + beta) ** 5 - 2 * (a + beta) ** 4, 5 * (a + beta) ** 4 - 8 * (a + beta) ** 3


def _third(a, beta=0.01, waves=39):
    if a <= 1 - beta:
        core, slope = 1 - a, -1.0
    elif a >= 1 + beta:
        core, slope = a - 1, 1.0
    else:
        core, slope = ((a - 1) ** 2 / beta + beta) / 2, (a - 1) / beta
    turn = waves * math.pi / 2
    wave = 2 * (1 - beta) / (waves * math.pi) * math.sin(turn * a)
    return core + wave, slope + (1 - beta) * math.cos(turn * a)


def _yanai(one, two):
    def gamma(beta):
        return math.sqrt(1 + beta**2) - beta

    def function(a):
        left, right = math.sqrt((1 - a) ** 2 + two**2), math.sqrt(a**2 + one**2)
        value = gamma(one) * left + gamma(two) * right
        return value, gamma(one) * (a - 1) / left + gamma(two) * a / right

    return function


_FUNCTIONS = {
    "1": _first,
    "2": _second,
    "3": _third,
    "4": _yanai(0.001, 0.001),
    "5": _yanai(0.01, 0.001),
    "6": _yanai(0.001, 0.01),
}


@pytest.mark.parametrize("first", [1e-3, 1e-1, 1e1])
@pytest.mark.parametrize("name", _FUNCTIONS)
@pytest.mark.parametrize("search", _WOLFE)
def test_wolfe_searches_keep_both_conditions(search, name, first):
    along = _FUNCTIONS[name]
    length = search.search(along, first)
    value, slope = along(0.0)
    found, tilt = along(length)
    assert length > 0.0
    assert found <= value + search.decrease * length * slope + 1e-12
    # Values of about 1 tell lengths apart down to slopes of 1e-6 only.
    assert abs(tilt) <= search.flatness * abs(slope) + 1e-6


@pytest.mark.parametrize("first", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", _FUNCTIONS)
def test_armijo_lowers_the_value_enough(name, first):
    along = _FUNCTIONS[name]
    length = Armijo().search(along, first)
    value, slope = along(0.0)
    assert 0.0 < length <= first
    assert along(length)[0] <= value + 1e-4 * length * slope


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_parabola_is_searched_to_its_rule_at_once(search):
    calls = []

    def along(a):
        calls.append(a)
        return (a - 1.0) ** 2, 2.0 * (a - 1.0)

    assert abs(search.search(along, 1.0) - 1.0) < 1e-12
    assert len(calls) <= 3


@pytest.mark.parametrize("search", _SEARCHES)
def test_what_only_rises_is_not_moved_along(search):
    # The slope lies: nothing lowers the value.
    assert search.search(lambda a: (abs(a), -1.0), 1.0) < 1e-6


@pytest.mark.parametrize("search", _SEARCHES)
def test_what_only_falls_ends(search):
    length = search.search(lambda a: (-a, -1.0), 1.0)
    assert math.isfinite(length)
    assert length >= 1.0


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_hole_of_no_number_is_stepped_back_from(search):
    def along(a):
        return ((a - 0.3) ** 2, 2 * (a - 0.3)) if a < 0.9 else (math.nan, math.nan)

    length = search.search(along, 1.0)
    assert 0.0 < length < 0.9
    assert np.isfinite(along(length)[0])


def test_settings_out_of_range_are_refused():
    with pytest.raises(InvalidInput, match="flatness must be above decrease"):
        StrongWolfe(decrease=0.5, flatness=0.4)
    with pytest.raises(InvalidInput, match="trials"):
        Armijo(trials=0)
    with pytest.raises(InvalidInput, match="longest"):
        MoreThuente(longest=0.0)
