"""Summaries of trajectory errors: statistics, and the numbers of the KITTI benchmark."""

from dataclasses import asdict, dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.evaluation.trajectory_errors import TrajectoryErrors


@dataclass(frozen=True, kw_only=True, slots=True)
class Statistics:
    """Statistics of errors, in their unit."""

    rmse: float
    """Root mean square."""

    mean: float
    """Mean."""

    median: float
    """Median."""

    std: float
    """Standard deviation about the mean."""

    smallest: float
    """Smallest error."""

    largest: float
    """Largest error."""

    @classmethod
    def of(cls, errors: Vector) -> "Statistics":
        """Compute the statistics of (n,) errors."""
        return cls(
            rmse=float(np.sqrt(np.mean(errors**2))),
            mean=float(errors.mean()),
            median=float(np.median(errors)),
            std=float(errors.std()),
            smallest=float(errors.min()),
            largest=float(errors.max()),
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class KittiSummary:
    """Mean errors of segments, as the KITTI odometry benchmark reports them."""

    length_m: float | None
    """Length of the segments [m]; None for all lengths together."""

    translation_percent: float
    """Mean translation error divided by the length, in percent."""

    rotation_deg_per_100_m: float
    """Mean rotation error divided by the length [deg / 100 m]."""

    segments: int
    """Number of segments."""


def summarise(errors: TrajectoryErrors) -> dict[str, dict[str, float]]:
    """Return the statistics of translations [m] and rotations [deg], ready for JSON."""
    return {
        "translation_m": asdict(Statistics.of(errors.translations)),
        "rotation_deg": asdict(Statistics.of(np.degrees(errors.rotations))),
    }


def summarise_kitti(errors: TrajectoryErrors) -> list[KittiSummary]:
    """Return the mean errors of all segments, then those of each length that occurs.

    Parameters
    ----------
    errors : TrajectoryErrors
        From `kitti_errors`.

    Returns
    -------
    list of KittiSummary
        Empty without a segment.
    """
    if len(errors) == 0:
        return []
    lengths: list[float | None] = [None, *np.unique(errors.lengths).tolist()]
    return [_mean_errors(errors, length) for length in lengths]


def _mean_errors(errors: TrajectoryErrors, length: float | None) -> KittiSummary:
    rows = np.full(len(errors), True) if length is None else errors.lengths == length
    along = errors.lengths[rows]
    return KittiSummary(
        length_m=length,
        translation_percent=100.0 * float((errors.translations[rows] / along).mean()),
        rotation_deg_per_100_m=100.0 * float(np.degrees((errors.rotations[rows] / along).mean())),
        segments=int(rows.sum()),
    )
