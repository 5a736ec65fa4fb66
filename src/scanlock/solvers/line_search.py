"""How far to go along a direction of descent: three rules that stand in for each other.

A search sees a function of the step length ``a`` that returns the value and the slope there, and
returns a length whose value and slope keep its rule, or the best length it has seen.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

from scanlock.errors import InvalidInput, require_count, require_fraction

Along = Callable[[float], tuple[float, float]]
"""Value and slope at a step length."""


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

    def search(self, along: Along, first: float) -> float:
        """Return the length, from `first` downwards; 0 where none lowers the value."""
        value, slope = along(0.0)
        length = first
        for _ in range(self.trials):
            tried, _ = along(length)
            if tried <= value + self.decrease * length * slope:
                return length
            # The parabola through value, slope and the tried value, kept within half a decade.
            bottom = -0.5 * slope * length**2 / (tried - value - slope * length)
            length = min(max(bottom, 0.1 * length), 0.5 * length) if bottom > 0 else 0.1 * length
        return 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class StrongWolfe:
    """Bracket and zoom until value and slope have both fallen: Nocedal & Wright 2006, 3.5, 3.6."""

    decrease: float = 1e-4
    """Share of the promised decrease."""

    flatness: float = 0.9
    """Largest magnitude of the slope, as a share of the first one."""

    longest: float = 20.0
    """Longest step, as a multiple of the first length."""

    trials: int = 30
    """Most lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_count("trials", self.trials)
        if not self.decrease < self.flatness:
            raise InvalidInput(f"flatness must be above decrease, got {self.flatness}")

    def search(self, along: Along, first: float) -> float:
        """Return the length; 0 where none lowers the value."""
        value, slope = along(0.0)
        low, low_value, low_slope = 0.0, value, slope
        length = first
        for trial in range(self.trials):
            tried, tilt = along(length)
            ceiling = value + self.decrease * length * slope
            if not tried <= ceiling or (trial > 0 and tried >= low_value):
                return self._zoom(along, (value, slope), (low, low_value, low_slope), length)
            if abs(tilt) <= -self.flatness * slope:
                return length
            if tilt >= 0.0:
                return self._zoom(along, (value, slope), (length, tried, tilt), low)
            low, low_value, low_slope = length, tried, tilt
            if length >= self.longest * first:
                return length
            length = min(2.0 * length, self.longest * first)
        return low

    def _zoom(
        self,
        along: Along,
        start: tuple[float, float],
        best: tuple[float, float, float],
        other: float,
    ) -> float:
        value, slope = start
        low, low_value, low_slope = best
        for _ in range(self.trials):
            length = _inside(low, low_value, low_slope, other, along(other)[0])
            tried, tilt = along(length)
            if not tried <= value + self.decrease * length * slope or tried >= low_value:
                other = length
                continue
            if abs(tilt) <= -self.flatness * slope:
                return length
            if tilt * (other - low) >= 0.0:
                other = low
            low, low_value, low_slope = length, tried, tilt
        return low


def _inside(low: float, value: float, slope: float, other: float, far: float) -> float:
    """Return the bottom of the parabola through one end, its slope and the other end."""
    width = other - low
    bend = far - value - slope * width
    middle = low + 0.5 * width
    if not math.isfinite(bend) or bend <= 0.0:
        return middle
    bottom = low - 0.5 * slope * width**2 / bend
    nearest, farthest = sorted((low + 0.1 * width, low + 0.9 * width))
    return min(max(bottom, nearest), farthest)
