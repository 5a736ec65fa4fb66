"""Which pairs are too far apart to be believed: a limit for each iteration of ICP.

Madhavan and Messina 2003, section 2.1, take theirs from Zhang 1994: a limit that follows the mean
and the deviation of the pair distances, in four cases told apart by D, the mean distance of scans
that are well aligned.
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

_VALLEY = 0.6
"""A valley of the histogram holds at most this share of the peak before it (Zhang 1994)."""

_FEWEST_BINS, _MOST_BINS = 10, 200
"""Bins of the histogram between nothing and the farthest pair."""


class Rejection(Protocol):
    """Settings that tell from the distances of all pairs how far apart a good pair may be."""

    @property
    def max_distance(self) -> float:
        """Distance beyond which no pair will ever be kept [m]; the search need not look there."""
        ...

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the largest distance of a good pair [m].

        Parameters
        ----------
        distances : (n,) [m]
            Of all pairs, at least one.
        previous : float [m]
            The limit of the iteration before; infinite until there is one to heed.
        spacing : float [m]
            Typical distance between neighbouring points of the target.
        """
        ...

    def note(self, spacing: float) -> str:
        """Return what the gate inferred from the spacing, for people; empty for nothing."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class FixedRejection:
    """The same limit in every iteration."""

    max_correspondence_distance: float = 1.0
    """Pairs farther apart are dropped [m]."""

    def __post_init__(self) -> None:
        require_positive("max_correspondence_distance", self.max_correspondence_distance, unit="m")

    @property
    def max_distance(self) -> float:
        """The limit itself [m]."""
        return self.max_correspondence_distance

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the fixed distance."""
        return self.max_correspondence_distance

    def note(self, spacing: float) -> str:
        """Return nothing: nothing was inferred."""
        return ""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrimmedRejection:
    """The limit that keeps the closest share of the pairs (Chetverikov et al. 2002)."""

    inlier_ratio: float = 0.7
    """Share of the pairs to keep, about the share of the source that the target shows too."""

    def __post_init__(self) -> None:
        require_positive("inlier_ratio", self.inlier_ratio)
        require_fraction("inlier_ratio", self.inlier_ratio)

    @property
    def max_distance(self) -> float:
        """Without end."""
        return np.inf

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the distance of the last pair of the closest share."""
        last = max(0, int(np.ceil(self.inlier_ratio * len(distances))) - 1)
        return float(np.partition(distances, last)[last])

    def note(self, spacing: float) -> str:
        """Return nothing: nothing was inferred."""
        return ""


@dataclass(frozen=True, kw_only=True, slots=True)
class AdaptiveRejection:
    """The adaptive limit of Madhavan and Messina 2003, with a rule that it cannot freeze small.

    With the mean mu and deviation sigma of the pair distances, the limit is ``mu + 3 sigma`` where
    ``mu < D``, ``mu + 2 sigma`` below 3 D, ``mu + sigma`` below 6 D, and beyond that the epsilon
    that the paper leaves open; here, as in Zhang 1994, the first valley of the histogram.
    """

    good_distance: float | None = None
    """Mean pair distance of well aligned scans, D [m]; None for `spacings` of the target's."""

    good_distance_in_spacings: float = 3.0
    """D over the typical distance between neighbouring points of the target.

    Zhang advises two to three. Scans a few metres apart hide parts of each other, which lifts the
    mean distance at the right pose to two or three times that of scans from one place.
    """

    statistics: Literal["all", "kept"] = "kept"
    """Mean and deviation of the pairs within the previous limit, as in Zhang 1994, or of all, as
    in the paper. What only one scan shows lifts the statistics of all pairs for good, so that the
    limit stays wide at the right pose."""

    min_threshold_ratio: float = 0.5
    """The limit is never below this share of D: closer pairs differ by sampling alone."""

    min_kept_ratio: float = 0.1
    """The limit is widened until this share of the pairs is kept, and at least `least_pairs`."""

    min_kept: int = 50
    """As many of the pairs as there are of these are always kept."""

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
        """Without end."""
        return np.inf

    def threshold(self, distances: Vector, previous: float, spacing: float) -> float:
        """Return the limit of the four cases, widened where it would keep too little."""
        least_count = max(self.min_kept, int(np.ceil(self.min_kept_ratio * len(distances))))
        last = min(least_count, len(distances)) - 1
        least_kept = float(np.partition(distances, last)[last])
        counted = distances
        # Statistics of what a small limit keeps are small themselves: never of too few pairs.
        if self.statistics == "kept" and previous >= least_kept:
            counted = distances[distances <= previous]
        good = self.good_distance_at(spacing)
        return max(self._by_case(counted, good), self.min_threshold_ratio * good, least_kept)

    def good_distance_at(self, spacing: float) -> float:
        """Return D [m] for a target of this spacing."""
        return (
            self.good_distance
            if self.good_distance is not None
            else self.good_distance_in_spacings * spacing
        )

    def note(self, spacing: float) -> str:
        """Return D and where it came from."""
        if self.good_distance is not None:
            return ""
        return (
            f"good pair distance D = {self.good_distance_at(spacing):.3g} m, "
            f"{self.good_distance_in_spacings:g} times the spacing of the target"
        )

    def _by_case(self, distances: Vector, good: float) -> float:
        mean, deviation = float(distances.mean()), float(distances.std())
        for most, deviations in ((good, 3.0), (3.0 * good, 2.0), (6.0 * good, 1.0)):
            if mean < most:
                return mean + deviations * deviation
        return valley_after_peak(distances)


def valley_after_peak(distances: Vector) -> float:
    """Return the first valley after the peak of the histogram of pair distances [m].

    A valley is a bin with at most 60 % of the peak and no more than the bin after it. Bins are
    as wide as Freedman and Diaconis 1981 advise. Where there is no valley before the last bin,
    the median is returned: half of the pairs are then believed.
    """
    low, middle, high = np.percentile(distances, [25, 50, 75])
    farthest = float(distances.max())
    width = 2.0 * (high - low) / np.cbrt(len(distances))
    if not width > 0.0:
        return float(middle)
    bins = int(np.clip(np.ceil(farthest / width), _FEWEST_BINS, _MOST_BINS))
    counts, edges = np.histogram(distances, bins, (0.0, farthest))
    peak = int(np.argmax(counts))
    after = np.arange(peak + 1, bins - 1)
    is_valley = (counts[after] <= _VALLEY * counts[peak]) & (counts[after] <= counts[after + 1])
    if not is_valley.any():
        return float(middle)
    valley = int(after[np.argmax(is_valley)])
    return float(0.5 * (edges[valley] + edges[valley + 1]))
