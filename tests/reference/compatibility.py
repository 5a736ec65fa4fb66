"""Pairwise consistency of cluster matches from the definition, one pair at a time."""

import itertools
import math

import numpy as np


def _full(packed):
    xx, xy, xz, yy, yz, zz = packed
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _sine_squared(one, other):
    """Of the angle between two axes given by the cosine and sine of their doubled angles."""
    return math.sin(0.5 * (math.atan2(*one[::-1]) - math.atan2(*other[::-1]))) ** 2


def level_misfit(target, source, target_covariances, source_covariances, turns, tolerances, a, b):
    """Sum of squared misfits of heights, horizontal distance and headings."""
    distance_tolerance, slope, angle, min_distance = tolerances
    vectors = [rows[a] - rows[b] for rows in (target, source)]
    covariances = [_full(rows[a] + rows[b]) for rows in (target_covariances, source_covariances)]
    lengths = [math.hypot(*vector[:2]) for vector in vectors]
    if min(lengths) < min_distance:
        return math.inf
    base = distance_tolerance**2
    vertical = sum(covariance[2, 2] for covariance in covariances)
    rise = vectors[0][2] - vectors[1][2]
    misfit = rise**2 / (base + (slope * lengths[0]) ** 2 + vertical)
    along = [np.array([*v[:2], 0.0]) / size for v, size in zip(vectors, lengths, strict=True)]
    across = [np.array([-line[1], line[0], 0.0]) for line in along]
    variance_along, variance_across = (
        sum(line @ covariance @ line for line, covariance in zip(lines, covariances, strict=True))
        for lines in (along, across)
    )
    misfit += (lengths[0] - lengths[1]) ** 2 / (base + variance_along)
    variance = angle**2 + (base + variance_across) / (lengths[0] * lengths[1])
    turn = math.atan2(along[0][1], along[0][0]) - math.atan2(along[1][1], along[1][0])
    doubled = (math.cos(2 * turn), math.sin(2 * turn))
    with_heading = [row for row in (a, b) if turns[row].any()]
    misfit += sum(_sine_squared(turns[row], doubled) for row in with_heading) / variance
    if len(with_heading) == 2:
        misfit += _sine_squared(turns[a], turns[b]) / (2 * angle**2)
    return misfit


def free_misfit(
    target,
    source,
    target_covariances,
    source_covariances,
    target_axes,
    source_axes,
    tolerances,
    a,
    b,
):
    """Sum of squared misfits of distance and of angles among axes and line."""
    distance_tolerance, _, angle, min_distance = tolerances
    vectors = [rows[a] - rows[b] for rows in (target, source)]
    covariances = [_full(rows[a] + rows[b]) for rows in (target_covariances, source_covariances)]
    lengths = [float(np.linalg.norm(vector)) for vector in vectors]
    if min(lengths) < min_distance:
        return math.inf
    base = distance_tolerance**2
    lines = [vector / size for vector, size in zip(vectors, lengths, strict=True)]
    along = sum(
        line @ covariance @ line for line, covariance in zip(lines, covariances, strict=True)
    )
    across = sum(float(np.trace(covariance)) for covariance in covariances) - along
    variance = angle**2 + (base + across / 2) / (lengths[0] * lengths[1])
    misfit = (lengths[0] - lengths[1]) ** 2 / (base + along)
    for row in (a, b):
        cosines = abs(target_axes[row] @ lines[0]), abs(source_axes[row] @ lines[1])
        misfit += (cosines[0] - cosines[1]) ** 2 / variance
    cosines = abs(target_axes[a] @ target_axes[b]), abs(source_axes[a] @ source_axes[b])
    return misfit + (cosines[0] - cosines[1]) ** 2 / (2 * angle**2)


def agreements(misfit, count, thresholds):
    """Consistency of any two matches at each threshold, by a misfit of two rows."""
    graph = np.zeros((len(thresholds), count, count), bool)
    for a, b in itertools.combinations(range(count), 2):
        graph[:, a, b] = graph[:, b, a] = misfit(b, a) <= np.asarray(thresholds)
    return graph


def soft_overlap(target, source, affinities, deviation):
    """Soft number of source clusters that overlap a similar target cluster."""
    distances = np.linalg.norm(source[:, None] - target, axis=2)
    near = np.where(distances < 3 * deviation, np.exp(-0.5 * (distances / deviation) ** 2), 0.0)
    counts = affinities * near
    best = np.zeros(len(target))
    for row in counts:
        best[row.argmax()] = max(best[row.argmax()], row.max())
    return best.sum()
