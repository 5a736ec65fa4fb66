"""Matches of parts of two scans that may be the same, and which of them can hold at once."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Mask, Matrix, Vector, read_only
from scanlock.kernels.compatibility import free_compatibility, level_compatibility
from scanlock.models.cluster_features import ClusterFeatures

_MOST_UNLIKE = 9.0
"""Parts whose squared differences, in tolerances, sum to more are never matched."""


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Rows of target and source that may be the same part, one pair a match."""

    target: Labels
    source: Labels

    def __len__(self) -> int:
        return len(self.target)

    @classmethod
    def mutual(cls, unlikeness: Matrix, nearest: int) -> "Matches":
        """Return the parts that are each among the `nearest` most alike of the other.

        Parameters
        ----------
        unlikeness : (source, target)
            Sum of squared differences in tolerances; infinite for those never to be matched.
        nearest : int
        """
        is_match = _mutually_near(unlikeness, nearest) & (unlikeness <= _MOST_UNLIKE)
        rows, columns = np.nonzero(is_match)
        return cls(columns, rows)

    def taken(self, rows: Labels | Mask) -> "Matches":
        """Return the matches at the given rows, in that order."""
        return Matches(self.target[rows], self.source[rows])

    def least(self, values: Vector, most: int) -> "Matches":
        """Return the `most` matches of least value, or all of them where they are no more."""
        if len(self) <= most:
            return self
        return self.taken(np.argsort(values, kind="stable")[:most])


@dataclass(frozen=True, slots=True)
class Tolerances:
    """By how much two views of a pair of parts may differ.

    Attributes
    ----------
    distance : float [m]
        Of their centres.
    slope : float
        Height difference per distance, between level frames.
    angle : float [rad]
        Of their axes.
    least_distance : float [m]
        Parts nearer than this agree about nothing.
    slack : float
        Share of a part's variance by which its centre slides, along each direction.
    """

    distance: float
    slope: float
    angle: float
    least_distance: float
    slack: float


def agreement_graphs(
    target: ClusterFeatures,
    source: ClusterFeatures,
    matches: Matches,
    tolerances: Tolerances,
    grades: tuple[float, ...],
    *,
    is_level: bool,
) -> NDArray[np.uint64]:
    """Return the (g, m, w) neighbours of m matches, as bits of words, at each grade.

    Heights and headings are compared where both frames are level; else only what no rotation
    changes.
    """
    at, of = matches.target, matches.source
    parts = (
        read_only(target.centres[at]),
        read_only(source.centres[of]),
        read_only(tolerances.slack * target.spreads[at]),
        read_only(tolerances.slack * source.spreads[of]),
    )
    limits = (
        read_only(
            np.array(
                [
                    tolerances.distance,
                    tolerances.slope,
                    tolerances.angle,
                    tolerances.least_distance,
                ]
            )
        ),
        read_only(np.array(grades)),
    )
    if is_level:
        turns = _turns(target.headings[at], source.headings[of])
        return level_compatibility(*parts, read_only(turns), *limits)
    axes = read_only(target.axes[at]), read_only(source.axes[of])
    return free_compatibility(*parts, *axes, *limits)


def _mutually_near(distances: Matrix, nearest: int) -> Mask:
    """Tell which entries are among the `nearest` least of both their row and their column."""
    least = [
        np.partition(distances, min(nearest, distances.shape[axis]) - 1, axis=axis).take(
            [min(nearest, distances.shape[axis]) - 1], axis=axis
        )
        for axis in (0, 1)
    ]
    return (distances <= least[0]) & (distances <= least[1])


def _turns(target: Matrix, source: Matrix) -> Matrix:
    """Return cosine and sine of twice the turns from source to target headings."""
    cosines = (target * source).sum(axis=1)
    sines = target[:, 1] * source[:, 0] - target[:, 0] * source[:, 1]
    return np.stack([cosines, sines], axis=1)
