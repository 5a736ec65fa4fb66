import numpy as np
import pytest

from reference import k_means as reference
from reference.grouping import partition
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.kernels.points.k_means import spread_seeds
from scanlock.models.k_means import KMeans


def _points(seed, count=300):
    return read_only(np.random.default_rng(seed).normal(0.0, [8.0, 4.0, 1.0], (count, 3)))


def _heaps(centres, seed=0):
    rng = np.random.default_rng(seed)
    parts = np.repeat(np.arange(len(centres)), 40)
    return np.array(centres)[parts] + rng.normal(0.0, 0.3, (len(parts), 3)), parts


@pytest.mark.parametrize("seed", range(5))
def test_seeds_are_drawn_by_squared_distance(seed):
    points = _points(seed)
    draws = read_only(np.random.default_rng(seed).random(12))
    rows = spread_seeds(points, draws)
    assert rows.tolist() == reference.spread_seeds(points, draws)
    assert len(set(rows.tolist())) == 12


def test_seeds_of_equal_points_are_rows_all_the_same():
    rows = spread_seeds(read_only(np.ones((4, 3))), read_only(np.array([0.9, 0.5, 0.999])))
    assert ((rows >= 0) & (rows < 4)).all()


def test_well_parted_heaps_are_the_parts():
    points, parts = _heaps([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30], [30, 30, 0]])
    labels = KMeans().labels(points, 5)
    assert partition(labels) == partition(parts)


def test_no_point_is_nearer_to_another_mean_in_the_end():
    points = _points(6, 600)
    labels = KMeans().labels(points, 20)
    means = np.array([points[labels == part].mean(axis=0) for part in range(20)])
    gaps = np.linalg.norm(points[:, None] - means, axis=2)
    np.testing.assert_array_equal(gaps.argmin(axis=1), labels)


def test_rounds_lower_the_spread_and_a_limit_stops_them():
    points = _points(7, 600)
    spreads = [
        reference.spread(points, KMeans(max_iterations=rounds).labels(points, 20))
        for rounds in (1, 3, 100)
    ]
    assert spreads[0] > spreads[1] > spreads[2]


def test_the_seed_decides_and_nothing_else():
    points = _points(8)
    first, again = (KMeans(seed=3).labels(points, 15) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert partition(first) != partition(KMeans(seed=4).labels(points, 15))


@pytest.mark.parametrize("count", [1, 5, 40])
def test_fewer_points_than_parts_give_as_many_parts_as_points(count):
    points = _points(9, 5)
    labels = KMeans().labels(points, count)
    assert len(set(labels.tolist())) == min(count, 5)
    assert KMeans().labels(np.empty((0, 3)), count).shape == (0,)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"seed": -1}, "seed must be a whole number"), ({"iterations": 0}, "iterations must be")],
)
def test_settings_out_of_range_are_refused_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        KMeans(**settings)


def test_no_part_at_all_is_refused():
    with pytest.raises(InvalidInput, match="count must be a whole number of at least 1, got 0"):
        KMeans().labels(_points(0), 0)
