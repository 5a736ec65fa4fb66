"""Self-similarity of a scan: the correlation of its view from above with itself moved.

The rows of a car park, the columns of an arcade and the trees of an avenue correlate with
themselves one period away, a street after half a turn, a crossing after a quarter. A pose may be
off by such a motion although the scans agree.
"""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from scanlock.arrays import Matrix, Points, frozen, read_only, short_repr
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.self_similarity import (
    common_correlation,
    peaks_above,
    view_from_above,
)
from scanlock.registration.verification.low_objects import OccupiedColumns

_HALF_SIDE = 24.0
"""Half side of the view from above [m]."""

_CELL_SIZE = 0.4
"""Side of its cells [m]."""

_MAX_BINS = 12
"""Maximum number of height bins of a cell: facades must not dominate."""

_MIN_SHIFT, _MAX_SHIFT = 1.5, 20.0
"""Translation of a self-match [m]; with a rotation there is no minimum."""

_MIN_PEAK = 0.25
"""Minimum correlation of a self-match."""

_PEAK_RADIUS = 4
"""Half side of the square in which a self-match has the highest correlation [cells]."""

_MIN_ENERGY = 1.0
"""Minimum correlation of the unmoved view: that of one occupied bin. An empty scan has 0."""

_MAX_MATCHES = 8
"""Maximum number of self-matches; a quarter turn and its opposite count as one."""

_TURNS = (0, 1, 2)
"""Quarter turns of the source of a correlation. Three quarters are the opposite of one."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SelfSimilarity:
    """Correlations of the view from above of a scan with itself.

    Attributes
    ----------
    correlations : tuple of (s, s)
        For no turn, a quarter turn and half a turn: the correlation with the turned view at each
        translation along x and y of the level frame, relative to that of the unmoved view. The
        middle cell is no translation.
    rotation : (3, 3)
        Rotation of the scan into the level frame.
    """

    correlations: tuple[Matrix, ...]
    rotation: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for one in self.correlations:
            frozen(one)

    @classmethod
    def of(cls, occupied: OccupiedColumns) -> "SelfSimilarity":
        """Compute the self-similarity of a scan from its occupied columns."""
        half = round(_HALF_SIDE / occupied.cell_size)
        merged = round(_CELL_SIZE / occupied.cell_size)
        view = view_from_above(occupied.columns, half, merged, _MAX_BINS)
        size = len(view) + round(_MAX_SHIFT / _CELL_SIZE)
        energy = max(float(np.vdot(view, view)), _MIN_ENERGY)
        spectrum = _spectrum(view, size)
        # Turned by 90 degrees the point (x, y) is at (-y, x).
        spectra = (spectrum, _spectrum(view.T[::-1], size), _spectrum(view[::-1, ::-1], size))
        return cls(
            correlations=tuple(_correlation(spectrum, one, size) / energy for one in spectra),
            rotation=occupied.rotation,
        )


def self_matches(
    target: SelfSimilarity, source: SelfSimilarity, pose: Pose
) -> tuple[float, tuple[Pose, ...]]:
    """Return the self-similarity that both scans share at a pose, and the motions of their match.

    Parameters
    ----------
    target, source : SelfSimilarity
    pose : Pose
        target_from_source.

    Returns
    -------
    similarity : float
        Largest correlation of both scans with themselves moved, in [0, 1]; of each motion the
        smaller one of both scans counts. 0 without motions.
    motions : tuple of Pose
        Motions with the largest correlations within 1.6 m around, above 0.25, in the frame of the
        target. Those without a rotation are periods.
    """
    found: list[tuple[float, int, Points]] = []
    for turn in _TURNS:
        common = _common_correlation(target, source, pose, turn)
        peaks = peaks_above(read_only(common), _MIN_PEAK, _PEAK_RADIUS)
        shifts = _CELL_SIZE * (peaks[:, :2] - len(common) // 2)
        lengths = np.hypot(*shifts.T)
        is_motion = (lengths <= _MAX_SHIFT) & ((lengths >= _MIN_SHIFT) | (turn > 0))
        rows = zip(peaks[is_motion, 2], shifts[is_motion], strict=True)
        found += [(float(value), turn, shift) for value, shift in rows]
    best = sorted(found, key=lambda one: -one[0])[:_MAX_MATCHES]
    motions: list[Pose] = []
    for _, turn, shift in best:
        motion = _motion(turn, shift, target.rotation)
        motions += [motion, motion.inverse()] if turn == 1 else [motion]
    return (best[0][0] if best else 0.0), tuple(motions)


def _spectrum(view: NDArray[np.float32], size: int) -> NDArray[np.complex64]:
    # The stubs of SciPy do not know the types of its transforms.
    return cast(NDArray[np.complex64], fft.rfft2(view, s=(size, size)))


def _correlation(
    spectrum: NDArray[np.complex64], moved: NDArray[np.complex64], size: int
) -> Matrix:
    """Return the correlation at translations of up to `_MAX_SHIFT` of the moved view."""
    full = cast(NDArray[np.float32], fft.irfft2(spectrum * moved.conj(), s=(size, size)))
    steps = round(_MAX_SHIFT / _CELL_SIZE)
    rows = np.arange(-steps, steps + 1) % size
    return full[rows[:, None], rows].astype(np.float64)


def _common_correlation(
    target: SelfSimilarity, source: SelfSimilarity, pose: Pose, turn: int
) -> Matrix:
    """Return the smaller correlation of both scans at each motion in the level frame of the target.

    A motion ``x -> Q x + t`` of the target is ``Q x + R' (t + Q p - p)`` in the frame of a source
    at p with the heading R.
    """
    level = target.rotation @ pose.rotation @ source.rotation.T
    yaw = math.atan2(level[1, 0] - level[0, 1], level[0, 0] + level[1, 1])
    x, y, _ = target.rotation @ pose.translation / _CELL_SIZE
    turned = ((x, y), (-y, x), (-x, -y))[turn]
    return common_correlation(
        target.correlations[turn],
        source.correlations[turn],
        math.cos(yaw),
        math.sin(yaw),
        float(turned[0] - x),
        float(turned[1] - y),
    )


def _motion(turn: int, shift: Points, level_rotation: Matrix) -> Pose:
    """Return a motion of the level frame, quarter turns and a (2,) translation, in the scan's."""
    cosine, sine = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0))[turn]
    rotation = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    return Pose(
        level_rotation.T @ rotation @ level_rotation, np.append(shift, 0.0) @ level_rotation
    )
