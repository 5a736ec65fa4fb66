"""Agreement of matches from the definition, one pair of matches at a time."""

import itertools
import math

import numpy as np


def _full(packed):
    xx, xy, xz, yy, yz, zz = packed
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _sine_squared(one, other):
    """Of the angle between two axes given by the cosine and sine of their doubled angles."""
    return math.sin(0.5 * (math.atan2(*one[::-1]) - math.atan2(*other[::-1]))) ** 2


def level_misfit(target, source, target_slack, source_slack, turns, tolerances, a, b):
    """Sum of squared misfits of heights, horizontal distance and headings."""
    base, slope, angle, least = tolerances
    gaps = [rows[a] - rows[b] for rows in (target, source)]
    slacks = [_full(rows[a] + rows[b]) for rows in (target_slack, source_slack)]
    far = [math.hypot(*gap[:2]) for gap in gaps]
    if min(far) < least:
        return math.inf
    upward = sum(slack[2, 2] for slack in slacks)
    outlier_ratio = (gaps[0][2] - gaps[1][2]) ** 2 / (base**2 + (slope * far[0]) ** 2 + upward)
    lines = [np.array([*gap[:2], 0.0]) / size for gap, size in zip(gaps, far, strict=True)]
    aside = [np.array([-line[1], line[0], 0.0]) for line in lines]
    along = sum(line @ slack @ line for line, slack in zip(lines, slacks, strict=True))
    across = sum(line @ slack @ line for line, slack in zip(aside, slacks, strict=True))
    outlier_ratio += (far[0] - far[1]) ** 2 / (base**2 + along)
    spread = angle**2 + (base**2 + across) / (far[0] * far[1])
    turn = math.atan2(lines[0][1], lines[0][0]) - math.atan2(lines[1][1], lines[1][0])
    doubled = (math.cos(2 * turn), math.sin(2 * turn))
    held = [row for row in (a, b) if turns[row].any()]
    outlier_ratio += sum(_sine_squared(turns[row], doubled) for row in held) / spread
    if len(held) == 2:
        outlier_ratio += _sine_squared(turns[a], turns[b]) / (2 * angle**2)
    return outlier_ratio


def free_misfit(
    target, source, target_slack, source_slack, target_axes, source_axes, tolerances, a, b
):
    """Sum of squared misfits of distance and of angles among axes and line."""
    base, _, angle, least = tolerances
    gaps = [rows[a] - rows[b] for rows in (target, source)]
    slacks = [_full(rows[a] + rows[b]) for rows in (target_slack, source_slack)]
    far = [float(np.linalg.norm(gap)) for gap in gaps]
    if min(far) < least:
        return math.inf
    lines = [gap / size for gap, size in zip(gaps, far, strict=True)]
    along = sum(line @ slack @ line for line, slack in zip(lines, slacks, strict=True))
    across = sum(float(np.trace(slack)) for slack in slacks) - along
    spread = angle**2 + (base**2 + across / 2) / (far[0] * far[1])
    outlier_ratio = (far[0] - far[1]) ** 2 / (base**2 + along)
    for row in (a, b):
        cosines = abs(target_axes[row] @ lines[0]), abs(source_axes[row] @ lines[1])
        outlier_ratio += (cosines[0] - cosines[1]) ** 2 / spread
    cosines = abs(target_axes[a] @ target_axes[b]), abs(source_axes[a] @ source_axes[b])
    return outlier_ratio + (cosines[0] - cosines[1]) ** 2 / (2 * angle**2)


def agreements(outlier_ratio, count, grades):
    """Whether each two matches agree, at each grade, of a function of two rows."""
    graph = np.zeros((len(grades), count, count), bool)
    for a, b in itertools.combinations(range(count), 2):
        graph[:, a, b] = graph[:, b, a] = outlier_ratio(b, a) <= np.asarray(grades)
    return graph


def soft_overlap(target, source, affinities, width):
    """Count of parts that meet their like."""
    distances = np.linalg.norm(source[:, None] - target, axis=2)
    near = np.where(distances < 3 * width, np.exp(-0.5 * (distances / width) ** 2), 0.0)
    counts = affinities * near
    taken = np.zeros(len(target))
    for row in counts:
        taken[row.argmax()] = max(taken[row.argmax()], row.max())
    return taken.sum()
