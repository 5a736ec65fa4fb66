import numpy as np

from scanlock.evaluation.trajectory_matching import match_equal, match_times


def test_each_row_matches_the_nearest_time_once():
    here = np.array([0.52, 0.5, 0.31, 0.0, 99.0])
    rows, others = match_times(here, 0.1 * np.arange(10))
    # 0.52 s is farther from 0.5 s than 0.5 s is, and 99 s matches none.
    assert rows.tolist() == [3, 2, 1]
    assert others.tolist() == [0, 3, 5]


def test_times_in_any_order_match():
    rng = np.random.default_rng(0)
    times = np.cumsum(rng.uniform(0.08, 0.12, 50))
    order = rng.permutation(50)
    rows, others = match_times(times, times[order])
    np.testing.assert_array_equal(rows, np.arange(50))
    np.testing.assert_array_equal(order[others], np.arange(50))


def test_the_limit_of_the_difference_is_respected():
    rows, _ = match_times(np.array([0.0]), np.array([0.2]))
    assert len(rows) == 0
    assert len(match_times(np.array([0.0]), np.array([0.2]), 0.3)[0]) == 1


def test_equal_numbers_match_in_the_order_of_the_first():
    rows, others = match_equal([30, 0, 10, 20], [10, 5, 30])
    assert rows.tolist() == [0, 2]
    assert others.tolist() == [2, 0]


def test_repeated_names_match_once():
    rows, others = match_equal(["a", "b", "a"], ["b", "a", "b"])
    assert rows.tolist() == [0, 1]
    assert others.tolist() == [1, 0]
