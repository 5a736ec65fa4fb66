"""Line searches: interchangeable rules for the length of a step along a descent direction.

A search gets a function of the step length ``a`` that returns value and slope there. It ends at a
length that satisfies its conditions or, failing that, at the best length tried. A value of NaN
counts as too high.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from scanlock.errors import InvalidInput, require_count, require_fraction

LineFunction = Callable[[float], tuple[float, float]]
"""Value and slope as a function of the step length."""


@dataclass(frozen=True, slots=True)
class LinePoint:
    """One length along a direction.

    Attributes
    ----------
    length, value, slope : float
        Step length, value there, and derivative of the value by the length.
    """

    length: float
    value: float
    slope: float

    @classmethod
    def at(cls, along: LineFunction, length: float) -> "LinePoint":
        """Return the point of a function at a length."""
        return cls(length, *along(length))


@dataclass(frozen=True, slots=True)
class LineStep:
    """Result of a line search.

    Attributes
    ----------
    point : LinePoint
        Point of length 0 where no length tried lowers the value.
    is_satisfied : bool
        Whether the point satisfies the conditions of the search; else it is the best one tried.
    """

    point: LinePoint
    is_satisfied: bool


@dataclass(frozen=True, kw_only=True, slots=True)
class Armijo:
    """Backtracking until the decrease is sufficient: Nocedal & Wright 2006, algorithm 3.1."""

    decrease: float = 1e-4
    """Sufficient decrease, as a fraction of the decrease by the first slope."""

    max_trials: int = 30
    """Maximum number of lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_count("max_trials", self.max_trials)

    def search(self, along: LineFunction, first: float, longest: float = math.inf) -> LineStep:
        """Return the first length with a sufficient decrease, from `first` downwards."""
        start = best = LinePoint.at(along, 0.0)
        length = min(first, longest)
        for _ in range(self.max_trials):
            here = LinePoint.at(along, length)
            if here.value <= sufficient_value(start, length, self.decrease):
                return LineStep(here, True)
            if here.value < best.value:
                best = here
            # The minimum of the parabola, within a decade.
            bottom = _parabola_minimum(start, here)
            length *= min(max(bottom / length, 0.1), 0.5) if math.isfinite(bottom) else 0.1
        return LineStep(best, False)


@dataclass(frozen=True, kw_only=True, slots=True)
class StrongWolfe:
    """Bracket and zoom to the strong Wolfe conditions: Nocedal & Wright 2006, 3.5 and 3.6."""

    decrease: float = 1e-4
    """Sufficient decrease, as a fraction of the decrease by the first slope; c1 in the book."""

    flatness: float = 0.9
    """Maximum absolute slope, as a fraction of the first one; c2 in the book."""

    max_trials: int = 30
    """Maximum number of lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_count("max_trials", self.max_trials)
        if not self.decrease < self.flatness:
            raise InvalidInput(
                f"flatness must be above decrease = {self.decrease}, got {self.flatness}"
            )

    def search(self, along: LineFunction, first: float, longest: float = math.inf) -> LineStep:
        """Return a length that satisfies both conditions: `first` if it does; at most `longest`."""
        start = before = LinePoint.at(along, 0.0)
        length = min(first, longest)
        for trial in range(self.max_trials):
            here, left = LinePoint.at(along, length), self.max_trials - trial - 1
            is_low = here.value <= sufficient_value(start, length, self.decrease)
            if not is_low or (trial > 0 and here.value >= before.value):
                return self._zoom(along, start, before, here, left)
            if is_flat(start, here, self.flatness):
                return LineStep(here, True)
            if here.slope >= 0.0:
                return self._zoom(along, start, here, before, left)
            before = here
            if length >= longest:
                break
            length = min(2.0 * length, longest)
        return LineStep(before, False)

    def _zoom(
        self, along: LineFunction, start: LinePoint, low: LinePoint, high: LinePoint, trials: int
    ) -> LineStep:
        """Return a length between `low`, the best sufficient one so far, and `high`."""
        for _ in range(trials):
            here = LinePoint.at(along, _interpolated(low, high))
            is_low = here.value <= sufficient_value(start, here.length, self.decrease)
            if not is_low or here.value >= low.value:
                high = here
                continue
            if is_flat(start, here, self.flatness):
                return LineStep(here, True)
            if here.slope * (high.length - low.length) >= 0.0:
                high = low
            low = here
        return LineStep(low, False)


def sufficient_value(start: LinePoint, length: float, decrease: float) -> float:
    """Return the maximum value of a sufficient decrease (Armijo) at a length."""
    return start.value + decrease * length * start.slope


def is_flat(start: LinePoint, here: LinePoint, flatness: float) -> bool:
    """Return whether the slope has fallen to a fraction of the one at the start."""
    return abs(here.slope) <= flatness * abs(start.slope)


def cubic_minimum(one: LinePoint, other: LinePoint) -> float:
    """Return the length of the minimum of the cubic through two points with their slopes.

    Nocedal & Wright 2006, equation 3.59; NaN where the cubic has no minimum.
    """
    width = other.length - one.length
    if width == 0.0:
        return math.nan
    bend = one.slope + other.slope - 3.0 * (other.value - one.value) / width
    square = bend * bend - one.slope * other.slope
    if not square >= 0.0:
        return math.nan
    root = math.copysign(math.sqrt(square), width)
    below = other.slope - one.slope + 2.0 * root
    return other.length - width * (other.slope + root - bend) / below if below else math.nan


def _parabola_minimum(one: LinePoint, other: LinePoint) -> float:
    """Return the length of the minimum of the parabola through two points and the first slope.

    NaN where the parabola has no minimum.
    """
    width = other.length - one.length
    rise = other.value - one.value - one.slope * width
    if not rise > 0.0:
        return math.nan
    return one.length - 0.5 * one.slope * width * (width / rise)


def _interpolated(low: LinePoint, high: LinePoint) -> float:
    """Return a length within an interval, at least a tenth of its width from either end."""
    width = high.length - low.length
    bottom = cubic_minimum(low, high)
    if not math.isfinite(bottom):
        return low.length + 0.5 * width
    return low.length + min(max((bottom - low.length) / width, 0.1), 0.9) * width
