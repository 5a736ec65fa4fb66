import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.pose_pairs import pose_pairs

STEPS = np.array([1.0, 2.0, 0.0, 0.5, 4.0, 1.0, 1.0])


def _listed(pairs):
    return list(zip(*(rows.tolist() for rows in pairs), strict=True))


def test_chained_pairs_end_at_the_first_row_far_enough():
    assert _listed(pose_pairs(STEPS, 3.0, "m")) == [(0, 2), (2, 5)]
    assert _listed(pose_pairs(STEPS, 0.1, "m")) == [(0, 1), (1, 2), (2, 4), (4, 5), (5, 6), (6, 7)]


def test_all_pairs_are_the_nearest_within_ten_percent():
    # From row 1 the nearest to 2 m is 2.0 m; from row 5 it is 2.0 m; from row 0, 1 or 3 m.
    assert _listed(pose_pairs(STEPS, 2.0, "m", all_pairs=True)) == [(1, 2), (5, 7)]


def test_pairs_of_scans_are_exactly_that_far_apart():
    ones = np.ones(20)
    assert _listed(pose_pairs(ones, 10, "scans")) == [(0, 10), (10, 20)]
    every = _listed(pose_pairs(ones, 10, "scans", all_pairs=True))
    assert every == [(row, row + 10) for row in range(11)]


@pytest.mark.parametrize(
    ("delta", "unit", "message"),
    [
        (9.6, "m", r"delta \[m\] must be below the path length of the trajectory, 9.5, got 9.6"),
        (0.0, "s", r"delta \[s\] must be positive"),
        (1.5, "scans", r"delta \[scans\] must be a whole number, got 1.5"),
        (8, "scans", r"must be below the scans of the trajectory"),
    ],
)
def test_impossible_distances_are_refused(delta, unit, message):
    steps = np.ones(7) if unit == "scans" else STEPS
    with pytest.raises(InvalidInput, match=message):
        pose_pairs(steps, delta, unit)
