"""The conditions of three line searches, on the functions of More and Thuente 1994, section 5."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.line_search import Armijo, StrongWolfe
from scanlock.optimisation.solvers.more_thuente import MoreThuente

_SEARCHES = [Armijo(), StrongWolfe(), MoreThuente()]
_WOLFE = [rule(flatness=flatness) for rule in (StrongWolfe, MoreThuente) for flatness in (0.1, 0.9)]


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


# For each function the paper's mu and eta, and for each first length the evaluations and the
# result of its tables I to VI.
_FIRSTS = (1e-3, 1e-1, 1e1, 1e3)
_TABLES = {
    "1": (1e-3, 1e-1, ((6, 1.4), (3, 1.4), (1, 10.0), (4, 37.0))),
    "2": (1e-1, 1e-1, ((12, 1.6), (8, 1.6), (8, 1.6), (11, 1.6))),
    "3": (1e-1, 1e-1, ((12, 1.0), (12, 1.0), (10, 1.0), (13, 1.0))),
    "4": (1e-3, 1e-3, ((4, 0.08), (1, 0.10), (3, 0.35), (4, 0.83))),
    "5": (1e-3, 1e-3, ((6, 0.075), (3, 0.078), (7, 0.073), (8, 0.076))),
    "6": (1e-3, 1e-3, ((13, 0.93), (11, 0.93), (8, 0.92), (11, 0.92))),
}


class _Counted:
    """A function along a line, and the lengths evaluated, except 0."""

    def __init__(self, function):
        self._function = function
        self.lengths = []

    def __call__(self, length):
        if length:
            self.lengths.append(length)
        return self._function(length)


@pytest.mark.parametrize("name", _FUNCTIONS)
def test_more_thuente_reproduces_the_published_tables(name):
    decrease, flatness, rows = _TABLES[name]
    search = MoreThuente(decrease=decrease, flatness=flatness)
    for first, (evaluations, length) in zip(_FIRSTS, rows, strict=True):
        along = _Counted(_FUNCTIONS[name])
        found = search.search(along, first)
        assert found.is_satisfied
        assert len(along.lengths) == evaluations
        # The tables have two digits, and not always the nearest.
        assert abs(found.point.length / length - 1.0) < 0.07


def _assert_wolfe(search, along, found):
    value, slope = along(0.0)
    point = found.point
    # Values of about 1 differ by more than rounding down to slopes of 1e-6 only.
    rounding = 1e-6 if isinstance(search, StrongWolfe) else 0.0
    assert found.is_satisfied or abs(point.slope) <= rounding
    assert point.length > 0.0
    # To rounding: an objective may sum in another order after an evaluation elsewhere.
    assert along(point.length) == pytest.approx((point.value, point.slope), rel=1e-12, abs=1e-14)
    assert point.value <= value + search.decrease * point.length * slope
    assert abs(point.slope) <= search.flatness * abs(slope) + rounding


@pytest.mark.parametrize("first", _FIRSTS)
@pytest.mark.parametrize("name", _FUNCTIONS)
@pytest.mark.parametrize("search", _WOLFE)
def test_wolfe_searches_satisfy_both_conditions(search, name, first):
    _assert_wolfe(search, _FUNCTIONS[name], search.search(_FUNCTIONS[name], first))


@pytest.mark.parametrize("first", _FIRSTS)
@pytest.mark.parametrize("name", _FUNCTIONS)
def test_armijo_decreases_the_value_sufficiently(name, first):
    along = _FUNCTIONS[name]
    found = Armijo().search(along, first)
    value, slope = along(0.0)
    assert found.is_satisfied
    assert 0.0 < found.point.length <= first
    assert found.point.value <= value + 1e-4 * found.point.length * slope


@given(
    st.floats(-2.0, 2.0), st.floats(0.05, 3.0), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0),
    st.sampled_from([1e-2, 1.0, 30.0]), st.sampled_from(_WOLFE),
)  # fmt: skip
def test_wolfe_searches_satisfy_both_conditions_on_wavy_bowls(
    one, bend, wave, phase, first, search
):
    def along(a):
        value = bend * a**2 + one * a + wave * math.sin(a + phase)
        return value, 2.0 * bend * a + one + wave * math.cos(a + phase)

    if along(0.0)[1] > -1e-3:
        return
    _assert_wolfe(search, along, search.search(along, first))


@pytest.mark.parametrize("search", [*_SEARCHES, *_WOLFE])
@pytest.mark.parametrize("seed", range(3))
def test_searches_satisfy_their_conditions_on_scores(search, seed):
    rng = np.random.default_rng(seed)
    some = gaussians(rng, 40)
    objective = GaussiansToGaussians(target=some, source=some)
    pose = yaw_pose(0.05, rng.uniform(-0.5, 0.5, 3))
    at = objective.linearise(pose)
    direction = -at.gradient[:3] / np.linalg.norm(at.gradient[:3])

    def along(length):
        here = objective.linearise(pose.retract(np.append(length * direction, np.zeros(3))))
        return here.value, float(here.gradient[:3] @ direction)

    for first in (0.05, 1.0, 20.0):
        found = search.search(along, first)
        assert found.is_satisfied
        if isinstance(search, Armijo):
            assert found.point.value < at.value
        else:
            _assert_wolfe(search, along, found)


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_parabola_takes_one_trial(search):
    along = _Counted(lambda a: ((a - 1.0) ** 2, 2.0 * (a - 1.0)))
    assert search.search(along, 1.0).point.length == 1.0
    assert along.lengths == [1.0]


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_rising_function_gives_length_zero(search):
    # The slope is wrong: no length lowers the value.
    found = search.search(lambda a: (abs(a), -1.0), 1.0)
    assert not found.is_satisfied
    assert found.point.length == 0.0


@pytest.mark.parametrize("search", [StrongWolfe(), MoreThuente()])
def test_a_falling_function_ends_at_the_maximum_length(search):
    found = search.search(lambda a: (-a, -1.0), 1.0, longest=7.0)
    assert not found.is_satisfied
    assert found.point.length == 7.0
    assert search.search(lambda a: (-a, -1.0), 9.0, longest=7.0).point.length == 7.0


@pytest.mark.parametrize("search", [StrongWolfe(), MoreThuente()])
def test_a_falling_function_without_a_maximum_length_ends(search):
    point = search.search(lambda a: (-a, -1.0), 1.0).point
    assert 1.0 < point.length < math.inf


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_flat_function_takes_one_trial(search):
    along = _Counted(lambda a: (3.0, 0.0))
    search.search(along, 1.0)
    assert along.lengths == [1.0]


@pytest.mark.parametrize("search", _SEARCHES)
def test_a_concave_start_is_searched(search):
    # Up to 1 the slope steepens, from 3 on it rises.
    found = search.search(lambda a: (math.cos(a + 0.1), -math.sin(a + 0.1)), 0.5)
    assert found.point.value < math.cos(0.1)
    assert found.is_satisfied


@pytest.mark.parametrize("hole", [math.nan, math.inf])
@pytest.mark.parametrize("search", _SEARCHES)
def test_lengths_without_a_finite_value_are_avoided(search, hole):
    def along(a):
        return ((a - 0.3) ** 2, 2 * (a - 0.3)) if a < 0.9 else (hole, hole)

    for first in (1.0, 50.0):
        found = search.search(along, first)
        assert 0.0 < found.point.length < 0.9
        assert found.point.value < 0.09


@pytest.mark.parametrize("search", _SEARCHES)
def test_nan_at_all_lengths_gives_length_zero(search):
    found = search.search(lambda a: (math.nan, math.nan) if a else (1.0, -1.0), 1.0)
    assert (found.point.length, found.is_satisfied) == (0.0, False)


@pytest.mark.parametrize("max_trials", [1, 2, 5])
@pytest.mark.parametrize("rule", [Armijo, StrongWolfe, MoreThuente])
def test_trials_do_not_exceed_the_maximum(rule, max_trials):
    along = _Counted(_FUNCTIONS["2"])
    strict = {} if rule is Armijo else {"flatness": 1e-3}
    found = rule(max_trials=max_trials, **strict).search(along, 1e3)
    assert len(along.lengths) <= max_trials
    tried = [along(length)[0] for length in (0.0, *along.lengths)]
    assert found.is_satisfied or found.point.value == min(tried)


def test_settings_out_of_range_are_rejected():
    with pytest.raises(InvalidInput, match=r"flatness must be above decrease = 0\.5, got 0\.4"):
        StrongWolfe(decrease=0.5, flatness=0.4)
    with pytest.raises(InvalidInput, match="max_trials"):
        Armijo(max_trials=0)
    with pytest.raises(InvalidInput, match="flatness must lie between 0 and 1"):
        MoreThuente(flatness=2.0)
