"""The line search of More and Thuente 1994, with which the normal distributions transform is used.

An interval holds the minimum of ``psi(a) = f(a) - f(0) - mu f'(0) a`` or, once psi has been below
zero on a rising slope, of ``f`` itself; one end is the best point so far. Interpolation chooses the
next length in four cases (section 4 of the paper), and each updates the interval (section 2).
"""

import math
from dataclasses import dataclass

from scanlock.errors import require_count, require_fraction
from scanlock.optimisation.solvers.line_search import (
    Along,
    LinePoint,
    LineStep,
    cubic_bottom,
    is_flat,
    promised,
)

_SHRINK = 0.66
"""An interval shrinks at least by this in two steps; a trial stays this far from its other end."""

_STRIDE = (1.1, 4.0)
"""Without an interval yet, the next step beyond a point, over the step that led there."""

_LEAST_WIDTH = 1e-14
"""Relative width of an interval that rounding cannot divide."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MoreThuente:
    """Settings of the search."""

    decrease: float = 1e-4
    """Share of the promised decrease, the paper's mu."""

    flatness: float = 0.9
    """Largest magnitude of the slope, as a share of the first one, the paper's eta."""

    trials: int = 30
    """Most lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_count("trials", self.trials)

    def search(self, along: Along, first: float, longest: float = math.inf) -> LineStep:
        """Return a length that keeps both rules: `first` if it does, never above `longest`."""
        start = LinePoint.at(along, 0.0)
        ends = _Ends(start, start, is_closed=False)
        is_early, widths = True, (math.inf, math.inf)
        length = min(first, longest)
        for _ in range(self.trials):
            here = LinePoint.at(along, length)
            if not math.isfinite(here.value + here.slope):
                longest, length = length, 0.5 * (ends.best.length + length)
                continue
            is_low = here.value <= promised(start, length, self.decrease)
            if is_low and is_flat(start, here, self.flatness):
                return LineStep(here, True)
            if is_low and length >= longest and here.slope <= self.decrease * start.slope:
                return LineStep(here, False)
            is_early = is_early and not (is_low and here.slope >= 0.0)
            # Section 3: psi serves as long as f has not fallen enough where it has fallen at all.
            uses_psi = is_early and not is_low and here.value <= ends.best.value
            tilt = self.decrease * start.slope if uses_psi else 0.0
            length, ends = ends.with_trial(here, tilt)
            if ends.is_closed:
                if ends.width <= _LEAST_WIDTH * max(ends.best.length, ends.other.length):
                    break
                if ends.width >= _SHRINK * widths[1] or not math.isfinite(length):
                    length = 0.5 * (ends.best.length + ends.other.length)
                widths = ends.width, widths[0]
            length = min(max(length, 0.0), longest)
        return LineStep(ends.best, False)


@dataclass(frozen=True, slots=True)
class _Ends:
    """The interval: its best end, the other one, and whether a minimum lies between them."""

    best: LinePoint
    other: LinePoint
    is_closed: bool

    @property
    def width(self) -> float:
        return abs(self.other.length - self.best.length)

    def with_trial(self, here: LinePoint, tilt: float) -> "tuple[float, _Ends]":
        """Return the next length to try, and the interval after this trial.

        Values are compared less ``tilt`` times their lengths: those of f for 0, else of psi.
        """
        best, other, tried = (_tilted(point, tilt) for point in (self.best, self.other, here))
        if tried.value > best.value:
            return _rising(best, tried), _Ends(self.best, here, True)
        if tried.slope * best.slope < 0.0:
            return _turning(best, tried), _Ends(here, self.best, True)
        ends = _Ends(here, self.other, self.is_closed)
        if self.is_closed:
            return _falling_inside(best, other, tried), ends
        return _falling_outside(best, tried), ends


def _tilted(point: LinePoint, tilt: float) -> LinePoint:
    return LinePoint(point.length, point.value - tilt * point.length, point.slope - tilt)


def _rising(best: LinePoint, tried: LinePoint) -> float:
    """Case 1: a higher value, so the minimum lies between."""
    width = tried.length - best.length
    cubic = cubic_bottom(best, tried)
    bend = (best.value - tried.value) / width + best.slope
    square = best.length + 0.5 * best.slope / bend * width
    if abs(cubic - best.length) < abs(square - best.length):
        return cubic
    return 0.5 * (cubic + square)


def _turning(best: LinePoint, tried: LinePoint) -> float:
    """Case 2: a lower value where the slope has turned round: the minimum lies between."""
    cubic, secant = cubic_bottom(best, tried), _secant(best, tried)
    return cubic if abs(cubic - tried.length) >= abs(secant - tried.length) else secant


def _falling_outside(best: LinePoint, tried: LinePoint) -> float:
    """Cases 3 and 4 without an interval yet: go on, at most four times as far as last time."""
    stride = tried.length - best.length
    nearest, farthest = (tried.length + factor * stride for factor in _STRIDE)
    if abs(tried.slope) >= abs(best.slope):
        return farthest
    cubic = cubic_bottom(best, tried)
    if not cubic > tried.length:
        cubic = farthest
    return min(max(cubic, _secant(best, tried), nearest), farthest)


def _falling_inside(best: LinePoint, other: LinePoint, tried: LinePoint) -> float:
    """Cases 3 and 4 within an interval: towards its other end, but not quite as far."""
    if abs(tried.slope) >= abs(best.slope):
        return cubic_bottom(tried, other)
    secant, cubic = _secant(best, tried), cubic_bottom(best, tried)
    is_beyond = (cubic - tried.length) * (tried.length - best.length) > 0.0
    is_nearer = abs(cubic - tried.length) < abs(secant - tried.length)
    length = cubic if is_beyond and is_nearer else secant
    edge = tried.length + _SHRINK * (other.length - tried.length)
    return min(length, edge) if tried.length > best.length else max(length, edge)


def _secant(one: LinePoint, other: LinePoint) -> float:
    """Return the length at which a slope that changes evenly is zero."""
    share = other.slope / (other.slope - one.slope)
    return other.length - share * (other.length - one.length)
