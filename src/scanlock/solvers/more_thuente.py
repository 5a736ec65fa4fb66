"""The line search of More and Thuente 1994, which NDT was published with."""

import math
from dataclasses import dataclass

from scanlock.errors import require_count, require_fraction, require_positive
from scanlock.solvers.line_search import Along

_Point = tuple[float, float, float]
"""Length, value and slope."""


@dataclass(frozen=True, kw_only=True, slots=True)
class MoreThuente:
    """Settings of the search; the defaults are those of the Point Cloud Library's NDT."""

    decrease: float = 1e-4
    """Share of the promised decrease, the paper's mu."""

    flatness: float = 0.9
    """Largest magnitude of the slope, as a share of the first one, the paper's eta."""

    longest: float = 20.0
    """Longest step, as a multiple of the first length."""

    trials: int = 30
    """Most lengths to try."""

    def __post_init__(self) -> None:
        require_fraction("decrease", self.decrease)
        require_fraction("flatness", self.flatness)
        require_positive("longest", self.longest)
        require_count("trials", self.trials)

    def search(self, along: Along, first: float) -> float:
        """Return the length; 0 where none lowers the value."""
        value, slope = along(0.0)
        limit = self.longest * first
        best: _Point = (0.0, value, slope)
        other: _Point = best
        bracketed, early = False, True
        widths = (limit, 2.0 * limit)
        length = first
        for _ in range(self.trials):
            tried, tilt = along(length)
            if not math.isfinite(tried):
                length = 0.5 * (best[0] + length)
                limit = min(limit, 2.0 * length)
                continue
            promised = value + self.decrease * length * slope
            if tried <= promised and abs(tilt) <= -self.flatness * slope:
                return length
            if length >= limit and tried <= promised and tilt <= self.decrease * slope:
                return length
            # The first stage works on psi, the value less the promised decrease.
            early = early and not (tried <= promised and tilt >= 0.0)
            shift = (
                self.decrease * slope if early and tried <= best[1] and tried > promised else 0.0
            )
            points = [
                (at, v - at * shift, s - shift) for at, v, s in (best, other, (length, tried, tilt))
            ]
            trial, bracketed = _trial(points[0], points[1], points[2], bracketed)
            reach = length - best[0]
            best, other = _updated(points[0], points[2], best, other, (length, tried, tilt))
            if bracketed:
                width = abs(other[0] - best[0])
                if width >= 0.66 * widths[1]:
                    trial = best[0] + 0.5 * (other[0] - best[0])
                widths = (width, widths[0])
                if width <= 1e-15 * max(abs(best[0]), abs(other[0])):
                    break
            else:
                # The paper's bounds on how fast an open interval grows.
                trial = min(max(trial, length + 1.1 * reach), length + 4.0 * reach)
            length = min(max(trial, 0.0), limit)
        return best[0]


def _updated(
    low: _Point, new: _Point, best: _Point, other: _Point, tried: _Point
) -> tuple[_Point, _Point]:
    """Return the ends of the interval that holds the minimum (their section 2).

    The first two points are what is compared, the value itself or psi; the last three are kept.
    """
    if new[1] > low[1]:
        return best, tried
    if new[2] * low[2] < 0.0:
        return tried, best
    return tried, other


def _trial(low: _Point, high: _Point, tried: _Point, bracketed: bool) -> tuple[float, bool]:
    """Return the next length, and whether a minimum is bracketed (section 4, four cases)."""
    (a, fa, ga), (b, fb, gb), (t, ft, gt) = low, high, tried
    if ft > fa:
        cubic = _cubic(a, fa, ga, t, ft, gt)
        square = a + 0.5 * ga * (t - a) / ((fa - ft) / (t - a) + ga)
        nearer = abs(cubic - a) < abs(square - a)
        return (cubic if nearer else cubic + 0.5 * (square - cubic)), True
    if gt * ga < 0.0:
        cubic = _cubic(a, fa, ga, t, ft, gt)
        secant = t + gt / (gt - ga) * (a - t)
        return (cubic if abs(cubic - t) > abs(secant - t) else secant), True
    if abs(gt) < abs(ga):
        secant = t + gt / (gt - ga) * (a - t)
        if not bracketed:
            return secant, False
        cubic = _cubic(a, fa, ga, t, ft, gt)
        inside = min(a, b) <= cubic <= max(a, b)
        chosen = cubic if inside and abs(cubic - t) < abs(secant - t) else secant
        edge = t + 0.66 * (b - t)
        return (min(edge, chosen) if t > a else max(edge, chosen)), True
    if bracketed:
        return _cubic(b, fb, gb, t, ft, gt), True
    return (math.inf if t > a else 0.0), False


def _cubic(a: float, fa: float, ga: float, b: float, fb: float, gb: float) -> float:
    """Return the minimum of the cubic through two values and two slopes."""
    if a == b:
        return a
    z = 3.0 * (fa - fb) / (b - a) + ga + gb
    root = math.copysign(math.sqrt(max(z * z - ga * gb, 0.0)), b - a)
    below = gb - ga + 2.0 * root
    if below == 0.0:
        return 0.5 * (a + b)
    return b - (b - a) * (gb + root - z) / below
