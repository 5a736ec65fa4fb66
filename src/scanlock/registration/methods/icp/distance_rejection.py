"""Rejection of correspondences by distance: fixed, trimmed, or an adaptive threshold.

The adaptive threshold is that of Madhavan and Messina 2003, section 2.1, after Zhang 1994. It
follows the mean and the standard deviation of the correspondence distances in four cases, which are
separated by D, the mean distance of well aligned scans.

Rejection by other properties, such as the angle of the normals, is in `correspondences`.
"""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)
from scanlock.optimisation.solvers.notes import LengthNote, Note

_MAX_VALLEY_RATIO = 0.6
"""Maximum count of a valley of the histogram over that of the peak before it (Zhang 1994)."""

_MIN_BINS, _MAX_BINS = 10, 200
"""Number of bins of the histogram between zero and the largest distance."""


class Rejection(Protocol):
    """Settings that compute the distance threshold of an iteration from all distances."""

    @property
    def max_distance(self) -> float:
        """Upper bound of all thresholds [m], to which the search is limited."""
        ...

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the maximum distance of the correspondences to keep [m].

        Parameters
        ----------
        distances : (n,) [m]
            Distances of all correspondences, at least one.
        previous : float [m]
            Threshold of the previous iteration. Infinite while statistics are to include all
            correspondences.
        spacing : float [m]
            Typical distance between neighbouring points of the target.
        """
        ...

    def note(self, spacing: float) -> Note:
        """Return a note on values derived from the spacing; empty if there are none."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class FixedRejection:
    """The same threshold in every iteration."""

    max_correspondence_distance: float = 1.0
    """Maximum distance of a correspondence [m]."""

    def __post_init__(self) -> None:
        require_positive("max_correspondence_distance", self.max_correspondence_distance, unit="m")

    @property
    def max_distance(self) -> float:
        """The fixed threshold [m]."""
        return self.max_correspondence_distance

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the fixed threshold [m]."""
        return self.max_correspondence_distance

    def note(self, spacing: float) -> Note:
        """Return an empty note."""
        return ""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrimmedRejection:
    """A threshold that keeps a fixed ratio of the correspondences (Chetverikov et al. 2002)."""

    inlier_ratio: float = 0.7
    """Ratio of the correspondences to keep, the closest ones. Choose about the overlap of the
    source with the target."""

    def __post_init__(self) -> None:
        require_positive("inlier_ratio", self.inlier_ratio)
        require_fraction("inlier_ratio", self.inlier_ratio)

    @property
    def max_distance(self) -> float:
        """Infinity: the threshold has no upper bound."""
        return np.inf

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the distance at the quantile of the inlier ratio [m]."""
        last = max(0, int(np.ceil(self.inlier_ratio * len(distances))) - 1)
        return float(np.partition(distances, last)[last])

    def note(self, spacing: float) -> Note:
        """Return an empty note."""
        return ""


@dataclass(frozen=True, kw_only=True, slots=True)
class AdaptiveRejection:
    """The adaptive threshold of Madhavan and Messina 2003, with lower bounds.

    With the mean mu and the standard deviation sigma of the distances, the threshold is
    ``mu + 3 sigma`` if ``mu < D``, ``mu + 2 sigma`` below 3 D and ``mu + sigma`` below 6 D. Beyond
    that it is the paper's epsilon, which is unspecified there. Here it is the first valley of the
    histogram of distances, as in Zhang 1994.
    """

    good_distance: float | None = None
    """Mean distance of the correspondences of well aligned scans, D [m]. None derives it from the
    spacing of the target."""

    good_distance_in_spacings: float = 3.0
    """D as a multiple of the typical distance between neighbouring points of the target.

    Zhang recommends two to three. Scans a few metres apart occlude parts of each other, which
    raises the mean distance at the true pose to two or three times that of scans from one position.
    """

    statistics: Literal["all", "kept"] = "kept"
    """Correspondences that enter mean and standard deviation: those within the previous threshold,
    as in Zhang 1994, or all, as in the paper. Surfaces that only one scan has raise the statistics
    of all correspondences, so that the threshold stays wide at the true pose."""

    min_threshold_ratio: float = 0.5
    """Minimum threshold as a ratio of D. Smaller distances are due to sampling."""

    min_kept_ratio: float = 0.1
    """Minimum ratio of correspondences to keep; the threshold is raised to keep them."""

    min_kept: int = 50
    """Minimum number of correspondences to keep."""

    def __post_init__(self) -> None:
        if self.good_distance is not None:
            require_positive("good_distance", self.good_distance, unit="m")
        require_positive("good_distance_in_spacings", self.good_distance_in_spacings)
        if self.statistics not in ("all", "kept"):
            raise InvalidInput(f"statistics must be 'all' or 'kept', got {self.statistics!r}")
        require_at_least("min_threshold_ratio", self.min_threshold_ratio, 0.0)
        require_fraction("min_kept_ratio", self.min_kept_ratio)
        require_count("min_kept", self.min_kept)

    @property
    def max_distance(self) -> float:
        """Infinity: the threshold has no upper bound."""
        return np.inf

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the threshold of the four cases [m], raised to its lower bounds."""
        min_kept = max(self.min_kept, int(np.ceil(self.min_kept_ratio * len(distances))))
        last = min(min_kept, len(distances)) - 1
        keeping_enough = float(np.partition(distances, last)[last])
        counted = distances
        # The statistics of few close correspondences are small and would shrink the threshold
        # further in each iteration.
        if self.statistics == "kept" and previous >= keeping_enough:
            counted = distances[distances <= previous]
        good = self.good_distance_at(spacing)
        lower_bound = self.min_threshold_ratio * good
        return max(self._by_case(counted, good), lower_bound, keeping_enough)

    def good_distance_at(self, spacing: float) -> float:
        """Return D [m] for a target of this spacing [m]."""
        return (
            self.good_distance
            if self.good_distance is not None
            else self.good_distance_in_spacings * spacing
        )

    def note(self, spacing: float) -> Note:
        """Return D if it was derived from the spacing."""
        if self.good_distance is not None:
            return ""
        return LengthNote(
            "good correspondence distance D = {:.3g} m, "
            f"{self.good_distance_in_spacings:g} times the spacing of the target",
            (self.good_distance_at(spacing),),
        )

    def _by_case(self, distances: Vector, good: float) -> float:
        mean, deviation = float(distances.mean()), float(distances.std())
        for upper, deviations in ((good, 3.0), (3.0 * good, 2.0), (6.0 * good, 1.0)):
            if mean < upper:
                return mean + deviations * deviation
        return valley_after_peak(distances)


def valley_after_peak(distances: Vector) -> float:
    """Return the first valley after the peak of the histogram of distances [m].

    A valley is a bin with at most 60 % of the count of the peak and no more than the next bin. The
    bin width is that of Freedman and Diaconis 1981. The median is returned if there is no valley
    before the last bin, which keeps half of the correspondences.
    """
    low, middle, high = np.percentile(distances, [25, 50, 75])
    farthest = float(distances.max())
    width = 2.0 * (high - low) / np.cbrt(len(distances))
    if not width > 0.0:
        return float(middle)
    bins = int(np.clip(np.ceil(farthest / width), _MIN_BINS, _MAX_BINS))
    counts, edges = np.histogram(distances, bins, (0.0, farthest))
    peak = int(np.argmax(counts))
    after = np.arange(peak + 1, bins - 1)
    is_low = counts[after] <= _MAX_VALLEY_RATIO * counts[peak]
    is_valley = is_low & (counts[after] <= counts[after + 1])
    if not is_valley.any():
        return float(middle)
    valley = int(after[np.argmax(is_valley)])
    return float(0.5 * (edges[valley] + edges[valley + 1]))
