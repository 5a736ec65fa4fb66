import numpy as np
import pytest

from reference import k_means as reference
from reference.grouping import partition
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.kernels.points.k_means import kmeans_plusplus
from scanlock.models.k_means import KMeans


def _points(seed, count=300):
    return read_only(np.random.default_rng(seed).normal(0.0, [8.0, 4.0, 1.0], (count, 3)))


def _clusters(centres, seed=0):
    rng = np.random.default_rng(seed)
    labels = np.repeat(np.arange(len(centres)), 40)
    return np.array(centres)[labels] + rng.normal(0.0, 0.3, (len(labels), 3)), labels


@pytest.mark.parametrize("seed", range(5))
def test_seeds_are_drawn_in_proportion_to_squared_distance(seed):
    points = _points(seed)
    draws = read_only(np.random.default_rng(seed).random(12))
    rows = kmeans_plusplus(points, draws)
    assert rows.tolist() == reference.kmeans_plusplus(points, draws)
    assert len(set(rows.tolist())) == 12


def test_seeds_of_identical_points_are_valid_rows():
    rows = kmeans_plusplus(read_only(np.ones((4, 3))), read_only(np.array([0.9, 0.5, 0.999])))
    assert ((rows >= 0) & (rows < 4)).all()


def test_well_separated_clusters_are_found():
    points, expected = _clusters([[0, 0, 0], [30, 0, 0], [0, 30, 0], [0, 0, 30], [30, 30, 0]])
    labels = KMeans().labels(points, 5)
    assert partition(labels) == partition(expected)


def test_every_point_is_assigned_to_the_nearest_mean():
    points = _points(6, 600)
    labels = KMeans().labels(points, 20)
    means = np.array([points[labels == k].mean(axis=0) for k in range(20)])
    distances = np.linalg.norm(points[:, None] - means, axis=2)
    np.testing.assert_array_equal(distances.argmin(axis=1), labels)


def test_iterations_decrease_the_sum_of_squares_up_to_their_maximum():
    points = _points(7, 600)
    sums = [
        reference.sum_of_squares(points, KMeans(max_iterations=count).labels(points, 20))
        for count in (1, 3, 100)
    ]
    assert sums[0] > sums[1] > sums[2]


def test_the_result_depends_on_the_seed_only():
    points = _points(8)
    first, again = (KMeans(seed=3).labels(points, 15) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    assert partition(first) != partition(KMeans(seed=4).labels(points, 15))


@pytest.mark.parametrize("count", [1, 5, 40])
def test_there_are_no_more_clusters_than_points(count):
    points = _points(9, 5)
    labels = KMeans().labels(points, count)
    assert len(set(labels.tolist())) == min(count, 5)
    assert KMeans().labels(np.empty((0, 3)), count).shape == (0,)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"seed": -1}, "seed must be a whole number"),
        ({"max_iterations": 0}, "max_iterations must be"),
    ],
)
def test_invalid_settings_are_rejected_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        KMeans(**settings)


def test_a_cluster_count_of_zero_is_rejected():
    with pytest.raises(InvalidInput, match="count must be a whole number of at least 1, got 0"):
        KMeans().labels(_points(0), 0)
