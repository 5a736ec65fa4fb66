"""Smooth curves in the plane, as centre lines of roads and paths of vehicles."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Matrix, Vector, frozen
from scanlock.errors import InvalidInput

_SPACING = 0.5
"""Distance between consecutive points of a track [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Track:
    """A curve in the x-y plane, parametrised by arc length.

    Build one with `Track.round` or `Track.straight`.

    Attributes
    ----------
    points : (k, 2) [m]
        Approximately equidistant points; a closed track does not repeat its first point.
    is_closed : bool
        Whether the last point is connected to the first.

    Raises
    ------
    InvalidInput
        Fewer than three points, or points of another shape.
    """

    points: Matrix
    is_closed: bool
    _ends: Vector = field(init=False)
    _headings: Vector = field(init=False)

    def __post_init__(self) -> None:
        points = np.array(self.points, np.float64)
        if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3:
            raise InvalidInput(f"points must have shape (k, 2) with k > 2, got {points.shape}")
        around = np.vstack([points, points[:1]]) if self.is_closed else points
        steps = np.diff(around, axis=0)
        ends = np.concatenate([[0.0], np.cumsum(np.linalg.norm(steps, axis=1))])
        # The heading at a point is that of the chord between its neighbours.
        if self.is_closed:
            chords = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
            chords = np.vstack([chords, chords[:1]])
        else:
            chords = np.gradient(points, axis=0)
        headings = np.unwrap(np.arctan2(chords[:, 1], chords[:, 0]))
        for name, array in (("points", points), ("_ends", ends), ("_headings", headings)):
            frozen(array)
            object.__setattr__(self, name, array)

    @classmethod
    def round(cls, corners: ArrayLike, bend: float) -> "Track":
        """Return a closed track around (k, 2) corners, rounded over a length of `bend` [m]."""
        around = np.asarray(corners, np.float64)
        around = np.vstack([around, around[:1]])
        dense = _resampled(around, _SPACING)[:-1]
        # Gaussian smoothing along the curve, by its Fourier series.
        frequency = np.fft.rfftfreq(len(dense), d=_SPACING)
        damping = np.exp(-2.0 * (np.pi * bend * frequency) ** 2)
        smooth = np.fft.irfft(np.fft.rfft(dense, axis=0) * damping[:, None], len(dense), axis=0)
        return cls(_resampled(np.vstack([smooth, smooth[:1]]), _SPACING)[:-1], True)

    @classmethod
    def straight(cls, start: ArrayLike, end: ArrayLike) -> "Track":
        """Return an open track between two (2,) points."""
        return cls(_resampled(np.array([start, end], np.float64), _SPACING), False)

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self._ends[-1])

    def heading(self, along: ArrayLike) -> Vector:
        """Return the (n,) headings [rad] at arc lengths [m]; closed tracks are repeated."""
        laps, within = self._within(along)
        turn = self._headings[-1] - self._headings[0] if self.is_closed else 0.0
        return np.interp(within, self._ends, self._headings) + laps * turn

    def at(self, along: ArrayLike, left: ArrayLike = 0.0) -> Matrix:
        """Return the (n, 2) positions [m] at arc lengths [m], offset by `left` [m] to the left."""
        _, within = self._within(along)
        points = np.vstack([self.points, self.points[:1]]) if self.is_closed else self.points
        on = np.column_stack([np.interp(within, self._ends, points[:, k]) for k in range(2)])
        heading = self.heading(along)
        aside = np.column_stack([-np.sin(heading), np.cos(heading)])
        return on + np.broadcast_to(left, within.shape)[:, None] * aside

    def beside(self, left: float) -> "Track":
        """Return the parallel track, offset by `left` [m] to the left."""
        return Track(self.at(self._ends[: len(self.points)], left), self.is_closed)

    def reversed(self) -> "Track":
        """Return the track in the opposite direction."""
        return Track(self.points[::-1], self.is_closed)

    def _within(self, along: ArrayLike) -> tuple[Vector, Vector]:
        """Return the number of complete laps, and arc lengths within one lap."""
        along = np.atleast_1d(np.asarray(along, np.float64))
        if not self.is_closed:
            return np.zeros(along.shape), along
        laps = np.floor(along / self.length)
        return laps, along - laps * self.length


def _resampled(corners: Matrix, spacing: float) -> Matrix:
    """Return equidistant points along a polyline, at most `spacing` [m] apart."""
    lengths = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    ends = np.concatenate([[0.0], np.cumsum(lengths)])
    count = int(np.ceil(ends[-1] / spacing)) + 1
    along = np.linspace(0.0, ends[-1], count)
    return np.column_stack([np.interp(along, ends, corners[:, k]) for k in range(2)])
