"""Line search of More and Thuente 1994, as the NDT of the Point Cloud Library uses it.

An interval contains the minimum of ``psi(a) = f(a) - f(0) - mu f'(0) a``. Once psi has been below
zero at a positive slope, the interval contains the minimum of ``f`` itself. One end is the best
point so far. Section 4 of the paper interpolates the next length in four cases, and section 2
updates the interval.
"""

import math
from dataclasses import dataclass

from scanlock.errors import require_count, require_fraction
from scanlock.optimisation.solvers.line_search import (
    LineFunction,
    LinePoint,
    LineStep,
    cubic_minimum,
    is_flat,
    sufficient_value,
)

_SHRINK = 0.66
"""Maximum width of an interval over its width two steps before; also the maximum length of a
trial step towards the other end of the interval."""

_STRIDE = (1.1, 4.0)
"""Range of the next step beyond a point over the step that led there, without an interval."""

_MIN_WIDTH = 1e-14
"""Minimum relative width of an interval, set by rounding."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MoreThuente:
    """Settings of the line search."""

    decrease: float = 1e-4
    """Sufficient decrease, as a fraction of the decrease by the first slope; mu in the paper."""

    flatness: float = 0.9
    """Maximum absolute slope, as a fraction of the first one; eta in the paper."""

    max_trials: int = 30
    """Maximum number of lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_count("max_trials", self.max_trials)

    def search(self, along: LineFunction, first: float, longest: float = math.inf) -> LineStep:
        """Return a length that satisfies both conditions: `first` if it does; at most `longest`."""
        start = LinePoint.at(along, 0.0)
        ends = _Ends(start, start, is_closed=False)
        is_early, widths = True, (math.inf, math.inf)
        length = min(first, longest)
        for _ in range(self.max_trials):
            here = LinePoint.at(along, length)
            if not math.isfinite(here.value + here.slope):
                longest, length = length, 0.5 * (ends.best.length + length)
                continue
            is_low = here.value <= sufficient_value(start, length, self.decrease)
            if is_low and is_flat(start, here, self.flatness):
                return LineStep(here, True)
            if is_low and length >= longest and here.slope <= self.decrease * start.slope:
                return LineStep(here, False)
            is_early = is_early and not (is_low and here.slope >= 0.0)
            # Section 3: psi is used while f has fallen, but not sufficiently.
            uses_psi = is_early and not is_low and here.value <= ends.best.value
            slope = self.decrease * start.slope if uses_psi else 0.0
            length, ends = ends.with_trial(here, slope)
            if ends.is_closed:
                if ends.width <= _MIN_WIDTH * max(ends.best.length, ends.other.length):
                    break
                if ends.width >= _SHRINK * widths[1] or not math.isfinite(length):
                    length = 0.5 * (ends.best.length + ends.other.length)
                widths = ends.width, widths[0]
            length = min(max(length, 0.0), longest)
        return LineStep(ends.best, False)


@dataclass(frozen=True, slots=True)
class _Ends:
    """Interval by its best end and the other one; closed once it contains a minimum."""

    best: LinePoint
    other: LinePoint
    is_closed: bool

    @property
    def width(self) -> float:
        return abs(self.other.length - self.best.length)

    def with_trial(self, here: LinePoint, slope: float) -> "tuple[float, _Ends]":
        """Return the next length to try, and the interval after this trial.

        A line of this slope is subtracted from the values: 0 compares those of f, else of psi.
        """
        points = self.best, self.other, here
        best, other, tried = (_less_line(point, slope) for point in points)
        if tried.value > best.value:
            return _rising(best, tried), _Ends(self.best, here, True)
        if tried.slope * best.slope < 0.0:
            return _turning(best, tried), _Ends(here, self.best, True)
        ends = _Ends(here, self.other, self.is_closed)
        if self.is_closed:
            return _falling_inside(best, other, tried), ends
        return _falling_outside(best, tried), ends


def _less_line(point: LinePoint, slope: float) -> LinePoint:
    return LinePoint(point.length, point.value - slope * point.length, point.slope - slope)


def _rising(best: LinePoint, tried: LinePoint) -> float:
    """Interpolate case 1: the value is higher, so the minimum lies between."""
    width = tried.length - best.length
    cubic = cubic_minimum(best, tried)
    bend = (best.value - tried.value) / width + best.slope
    square = best.length + 0.5 * best.slope / bend * width
    if abs(cubic - best.length) < abs(square - best.length):
        return cubic
    return 0.5 * (cubic + square)


def _turning(best: LinePoint, tried: LinePoint) -> float:
    """Interpolate case 2: the value is lower and the slope has changed sign."""
    cubic, secant = cubic_minimum(best, tried), _secant(best, tried)
    return cubic if abs(cubic - tried.length) >= abs(secant - tried.length) else secant


def _falling_outside(best: LinePoint, tried: LinePoint) -> float:
    """Extrapolate cases 3 and 4 without an interval, by at most four times the last step."""
    stride = tried.length - best.length
    nearest, farthest = (tried.length + factor * stride for factor in _STRIDE)
    if abs(tried.slope) >= abs(best.slope):
        return farthest
    cubic = cubic_minimum(best, tried)
    if not cubic > tried.length:
        cubic = farthest
    return min(max(cubic, _secant(best, tried), nearest), farthest)


def _falling_inside(best: LinePoint, other: LinePoint, tried: LinePoint) -> float:
    """Interpolate cases 3 and 4 within an interval, short of its other end."""
    if abs(tried.slope) >= abs(best.slope):
        return cubic_minimum(tried, other)
    secant, cubic = _secant(best, tried), cubic_minimum(best, tried)
    is_beyond = (cubic - tried.length) * (tried.length - best.length) > 0.0
    is_nearer = abs(cubic - tried.length) < abs(secant - tried.length)
    length = cubic if is_beyond and is_nearer else secant
    edge = tried.length + _SHRINK * (other.length - tried.length)
    return min(length, edge) if tried.length > best.length else max(length, edge)


def _secant(one: LinePoint, other: LinePoint) -> float:
    """Return the length of zero slope by linear interpolation."""
    ratio = other.slope / (other.slope - one.slope)
    return other.length - ratio * (other.length - one.length)
