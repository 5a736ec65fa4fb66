"""How far to go along a direction of descent: three rules that stand in for each other.

A search sees a function of the step length ``a`` that returns the value and the slope there. It
ends at a length where value and slope keep its rule or, failing that, at the best length it has
tried. A value that is no number is one that is too high.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from scanlock.errors import InvalidInput, require_count, require_fraction

Along = Callable[[float], tuple[float, float]]
"""Value and slope at a step length."""


@dataclass(frozen=True, slots=True)
class LinePoint:
    """One length along a direction.

    Attributes
    ----------
    length, value, slope : float
        The slope is that of the value over the length.
    """

    length: float
    value: float
    slope: float

    @classmethod
    def at(cls, along: Along, length: float) -> "LinePoint":
        """Return what a function is at a length."""
        return cls(length, *along(length))


@dataclass(frozen=True, slots=True)
class LineStep:
    """Where a line search ended.

    Attributes
    ----------
    point : LinePoint
        At length 0 where nothing tried lowers the value.
    is_kept : bool
        Whether value and slope keep the rule of the search; else the point is the best tried.
    """

    point: LinePoint
    is_kept: bool


@dataclass(frozen=True, kw_only=True, slots=True)
class Armijo:
    """Shorten the step until the value falls by a share of what the slope promises."""

    decrease: float = 1e-4
    """Share of the promised decrease."""

    trials: int = 30
    """Most lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_count("trials", self.trials)

    def search(self, along: Along, first: float, longest: float = math.inf) -> LineStep:
        """Return the first length that keeps the rule, from `first` downwards."""
        start = best = LinePoint.at(along, 0.0)
        length = min(first, longest)
        for _ in range(self.trials):
            here = LinePoint.at(along, length)
            if here.value <= promised(start, length, self.decrease):
                return LineStep(here, True)
            if here.value < best.value:
                best = here
            # The bottom of the parabola, kept within a decade.
            bottom = _parabola_bottom(start, here)
            length *= min(max(bottom / length, 0.1), 0.5) if math.isfinite(bottom) else 0.1
        return LineStep(best, False)


@dataclass(frozen=True, kw_only=True, slots=True)
class StrongWolfe:
    """Bracket and zoom until value and slope have both fallen: Nocedal & Wright 2006, 3.5, 3.6."""

    decrease: float = 1e-4
    """Share of the promised decrease."""

    flatness: float = 0.9
    """Largest magnitude of the slope, as a share of the first one."""

    trials: int = 30
    """Most lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_count("trials", self.trials)
        if not self.decrease < self.flatness:
            raise InvalidInput(
                f"flatness must be above decrease, {self.decrease}, got {self.flatness}"
            )

    def search(self, along: Along, first: float, longest: float = math.inf) -> LineStep:
        """Return a length that keeps both rules: `first` if it does, never above `longest`."""
        start = before = LinePoint.at(along, 0.0)
        length = min(first, longest)
        for trial in range(self.trials):
            here, left = LinePoint.at(along, length), self.trials - trial - 1
            is_low = here.value <= promised(start, length, self.decrease)
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
        self, along: Along, start: LinePoint, low: LinePoint, high: LinePoint, trials: int
    ) -> LineStep:
        """Return a length between `low`, the best that is low enough so far, and `high`."""
        for _ in range(trials):
            here = LinePoint.at(along, _between(low, high))
            is_low = here.value <= promised(start, here.length, self.decrease)
            if not is_low or here.value >= low.value:
                high = here
                continue
            if is_flat(start, here, self.flatness):
                return LineStep(here, True)
            if here.slope * (high.length - low.length) >= 0.0:
                high = low
            low = here
        return LineStep(low, False)


def promised(start: LinePoint, length: float, decrease: float) -> float:
    """Return the highest value that falls by a share of what the slope at the start promises."""
    return start.value + decrease * length * start.slope


def is_flat(start: LinePoint, here: LinePoint, flatness: float) -> bool:
    """Tell whether the slope has fallen to a share of the one at the start."""
    return abs(here.slope) <= flatness * abs(start.slope)


def cubic_bottom(one: LinePoint, other: LinePoint) -> float:
    """Return the length of the minimum of the cubic through two points and their slopes.

    Not a number where the cubic has no minimum.
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


def _parabola_bottom(one: LinePoint, other: LinePoint) -> float:
    """Return the length of the minimum of the parabola through two points and the first's slope.

    Not a number where the parabola has no minimum.
    """
    width = other.length - one.length
    rise = other.value - one.value - one.slope * width
    if not rise > 0.0:
        return math.nan
    return one.length - 0.5 * one.slope * width * (width / rise)


def _between(low: LinePoint, high: LinePoint) -> float:
    """Return a length within an interval, off its ends by a tenth of its width at least."""
    width = high.length - low.length
    bottom = cubic_bottom(low, high)
    if not math.isfinite(bottom):
        return low.length + 0.5 * width
    return low.length + min(max((bottom - low.length) / width, 0.1), 0.9) * width
