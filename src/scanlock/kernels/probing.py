"""What the points of one scan look like around given places: counts, means and covariances."""

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points
from scanlock.kernels._compile import kernel

_BLOCK = 256
"""Points whose slots are computed at a time, for the sake of vector units."""

_SLOTS_EACH = 32
"""Slots of the table for each probe, at least: most points then find theirs empty."""

_CORNERS = 8
"""Cubes of twice the radius that lie around a corner, one of which holds each probe in reach."""

_SUMS = 10
"""The count, the three sums and the six products of the offsets from a probe."""


@kernel
def _slot(i: np.int64, j: np.int64, k: np.int64, last: int) -> np.int64:
    """Return where the probes around a corner are listed (Teschner et al. 2003)."""
    return ((i * 73856093) ^ (j * 19349663) ^ (k * 83492791)) & last


@kernel
def _listed(
    probes: Points, edge: float, first: NDArray[np.int32], following: NDArray[np.int32]
) -> None:
    """List each probe at the eight corners of its cube of side `edge`.

    `first` holds the head of each slot's list, `following` the entry after each; entry e is of
    probe ``e // 8``; -1 ends a list. Corners that share a slot are told apart by nothing: what is
    listed too often is out of reach, and fails the test of distance.
    """
    last = first.shape[0] - 1
    for probe in range(probes.shape[0]):
        i = np.int64(np.floor(probes[probe, 0] / edge))
        j = np.int64(np.floor(probes[probe, 1] / edge))
        k = np.int64(np.floor(probes[probe, 2] / edge))
        for corner in range(_CORNERS):
            slot = _slot(i - (corner & 1), j - ((corner >> 1) & 1), k - (corner >> 2), last)
            # The entries of a probe come one after another: a second one would count it twice.
            if first[slot] < 0 or first[slot] // _CORNERS != probe:
                entry = _CORNERS * probe + corner
                following[entry] = first[slot]
                first[slot] = entry


@kernel
def sums_near(points: Points, probes: Points, radius: float) -> Matrix:
    """Return (m, 10) sums over the points nearer than `radius` to each of (m, 3) probes.

    Of the offsets d from the probe: how many, ``d`` (3), and the upper triangle of ``d d'`` (6) in
    the order xx, xy, xz, yy, yz, zz.
    """
    n, m = points.shape[0], probes.shape[0]
    slots = 1
    while slots < _SLOTS_EACH * m:
        slots *= 2
    edge = 2.0 * radius
    first = np.full(slots, -1, np.int32)
    following = np.full(_CORNERS * m, -1, np.int32)
    _listed(probes, edge, first, following)
    sums = np.zeros((m, _SUMS))
    found = np.zeros(_BLOCK, np.int64)
    place = np.zeros((3, _BLOCK))
    for start in range(0, n, _BLOCK):
        count = min(_BLOCK, n - start)
        for p in range(count):
            place[0, p] = points[start + p, 0]
            place[1, p] = points[start + p, 1]
            place[2, p] = points[start + p, 2]
        for p in range(_BLOCK):
            # The corner nearest to a point: the cubes around it hold all that is in reach.
            i = np.int64(np.floor(place[0, p] / edge - 0.5))
            j = np.int64(np.floor(place[1, p] / edge - 0.5))
            k = np.int64(np.floor(place[2, p] / edge - 0.5))
            found[p] = _slot(i, j, k, slots - 1)
        for p in range(count):
            entry = first[found[p]]
            while entry >= 0:
                probe = entry // _CORNERS
                x = place[0, p] - probes[probe, 0]
                y = place[1, p] - probes[probe, 1]
                z = place[2, p] - probes[probe, 2]
                if x * x + y * y + z * z < radius * radius:
                    sums[probe, 0] += 1.0
                    sums[probe, 1] += x
                    sums[probe, 2] += y
                    sums[probe, 3] += z
                    sums[probe, 4] += x * x
                    sums[probe, 5] += x * y
                    sums[probe, 6] += x * z
                    sums[probe, 7] += y * y
                    sums[probe, 8] += y * z
                    sums[probe, 9] += z * z
                entry = following[entry]
    return sums
