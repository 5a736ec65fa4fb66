"""Self-similarity of a scan: the correlation of its view from above with itself displaced.

The rows of a car park, the columns of an arcade and the trees of an avenue correlate with
themselves one period away. A pose may be off by a period although the scans agree.
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
"""Length of a period [m]."""

_MIN_PEAK = 0.25
"""Minimum correlation of a period."""

_PEAK_RADIUS = 4
"""Half side of the square in which a period has the highest correlation [cells]."""

_MIN_ENERGY = 1.0
"""Least correlation without displacement: that of one occupied bin. A scan without any has 0."""

_MAX_PERIODS = 8
"""Maximum number of periods, a displacement and its opposite counted as two."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SelfSimilarity:
    """Autocorrelation of the view from above of a scan.

    Attributes
    ----------
    correlation : (s, s)
        Correlation at each displacement along x and y of the level frame, 1 without displacement;
        the middle cell is no displacement.
    rotation : (3, 3)
        Rotation of the scan into the level frame.
    """

    correlation: NDArray[np.float64]
    rotation: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.correlation)

    @classmethod
    def of(cls, occupied: OccupiedColumns) -> "SelfSimilarity":
        """Compute the self-similarity of a scan from its occupied columns."""
        half = round(_HALF_SIDE / occupied.cell_size)
        merged = round(_CELL_SIZE / occupied.cell_size)
        view = view_from_above(occupied.columns, half, merged, _MAX_BINS)
        steps = round(_MAX_SHIFT / _CELL_SIZE)
        size = len(view) + steps
        # The stubs of SciPy do not know the types of its transforms.
        spectrum = cast(NDArray[np.complex64], fft.rfft2(view, s=(size, size)))
        power = spectrum.real**2 + spectrum.imag**2
        full = cast(NDArray[np.float32], fft.irfft2(power, s=(size, size)))
        rows = np.arange(-steps, steps + 1) % size
        correlation = full[rows[:, None], rows].astype(np.float64)
        correlation /= max(float(correlation[steps, steps]), _MIN_ENERGY)
        return cls(correlation=correlation, rotation=occupied.rotation)


def common_periods(
    target: SelfSimilarity, source: SelfSimilarity, pose: Pose
) -> tuple[float, Points]:
    """Return the self-similarity that both scans share at a pose, and their periods.

    Parameters
    ----------
    target, source : SelfSimilarity
    pose : Pose
        target_from_source.

    Returns
    -------
    similarity : float
        Largest correlation of both scans with themselves displaced by a period, in [0, 1]; at each
        displacement the smaller one of both scans counts. 0 without periods.
    periods : (k, 3) [m]
        Displacements of 1.5 to 20 m with the largest correlations within 1.6 m around, above 0.25,
        in the frame of the target.
    """
    level = target.rotation @ pose.rotation @ source.rotation.T
    yaw = math.atan2(level[1, 0] - level[0, 1], level[0, 0] + level[1, 1])
    common = common_correlation(
        target.correlation,
        source.correlation,
        math.cos(yaw),
        math.sin(yaw),
    )
    peaks = peaks_above(read_only(common), _MIN_PEAK, _PEAK_RADIUS)
    shifts = np.zeros((len(peaks), 3))
    shifts[:, :2] = _CELL_SIZE * (peaks[:, :2] - len(common) // 2)
    lengths = np.linalg.norm(shifts, axis=1)
    rows = np.flatnonzero((lengths >= _MIN_SHIFT) & (lengths <= _MAX_SHIFT))
    best = rows[np.argsort(-peaks[rows, 2], kind="stable")[:_MAX_PERIODS]]
    similarity = float(peaks[best[0], 2]) if len(best) else 0.0
    return similarity, shifts[best] @ target.rotation
