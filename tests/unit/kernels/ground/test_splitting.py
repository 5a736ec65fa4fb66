import numpy as np
import pytest

from reference import grouping
from scanlock.arrays import read_only
from scanlock.kernels.ground.splitting import split_by_extent


def _split(points, labels, count, radius):
    """Labels of the points after the split, and their number."""
    rows, runs, _ = split_by_extent(
        read_only(points), read_only(labels), count, read_only(np.array([float(radius)])), True
    )
    assert sorted(rows) == np.flatnonzero(labels >= 0).tolist()
    split = np.full(len(points), -1)
    for label, (scale, begin, end) in enumerate(runs):
        assert scale == 0
        split[rows[begin:end]] = label
    return split, len(runs)


@pytest.mark.parametrize("radius", [0.8, 1.5, 4.0, 100.0])
def test_splits_of_long_clusters_match_the_definition(radius):
    # Walls and poles remain elongated after every split, so their longest axis is well defined.
    rng = np.random.default_rng(8)
    walls = [rng.uniform(-0.5, 0.5, (150, 3)) * size for size in ([20, 0.2, 0.2], [0.1, 9, 0.1])]
    pole = rng.uniform(-0.5, 0.5, (150, 3)) * [0.1, 0.1, 7.0]
    points = np.concatenate([*walls, pole]) + rng.uniform(-30, 30, 3)
    labels = np.repeat([0, 1, 2], 150)
    split, count = _split(points, labels, 3, radius)
    expected = set()
    for label in range(3):
        expected |= grouping.pieces(points, np.flatnonzero(labels == label).tolist(), radius)
    assert grouping.partition(split) == expected
    assert count == len(expected)


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_identical_points_are_not_split(count):
    points = np.tile([3.1, -0.7, 12.3], (count, 1))
    labels, label_count = _split(points, np.zeros(count, np.int64), 1, 1e-6)
    assert label_count == 1
    np.testing.assert_array_equal(labels, 0)


@pytest.mark.parametrize("distance", [1e-3, 1.0, 1e9])
def test_two_points_are_split_beyond_the_radius_from_their_mean(distance):
    points = np.array([[0.0, 0.0, 0.0], [distance, distance, 0.0]])
    half = np.sqrt(0.5) * distance
    together, count = _split(points, np.zeros(2, np.int64), 1, 1.01 * half)
    assert (count, set(together)) == (1, {0})
    separate, count = _split(points, np.zeros(2, np.int64), 1, 0.99 * half)
    assert (count, set(separate)) == (2, {0, 1})


def test_points_without_a_label_remain_unlabelled():
    labels = np.array([-1, 0, -1, 0])
    split, count = _split(np.arange(12.0).reshape(4, 3), labels, 1, 1.0)
    assert count == 2
    np.testing.assert_array_equal(split < 0, labels < 0)


def test_empty_clusters_get_no_label():
    split, count = _split(np.zeros((2, 3)), np.array([3, 1]), 5, 1.0)
    assert count == 2
    assert sorted(split) == [0, 1]


def test_moments_at_all_radii_are_those_of_the_points():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(700, 3)) * [20.0, 4.0, 1.0]
    labels = rng.integers(-1, 3, 700)
    radii = np.array([30.0, 5.0, 2.0, 0.5])
    arguments = read_only(points), read_only(labels), 3, read_only(radii)
    rows, runs, moments = split_by_extent(*arguments, True)
    no_rows, same_runs, same_moments = split_by_extent(*arguments, False)
    assert len(no_rows) == 0
    np.testing.assert_array_equal(same_runs, runs)
    np.testing.assert_array_equal(same_moments, moments)
    assert set(runs[:, 0]) == {0, 1, 2, 3}
    for (scale, begin, end), own in zip(runs, moments, strict=True):
        members = points[rows[begin:end]]
        assert np.linalg.norm(members - members.mean(axis=0), axis=1).max() <= radii[scale]
        covariance = np.cov(members.T, bias=True).reshape(3, 3)
        np.testing.assert_allclose(own[:3], members.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(own[3:], covariance[np.triu_indices(3)], atol=1e-12)
    for scale in range(4):
        own = runs[runs[:, 0] == scale]
        own = own[np.argsort(own[:, 1])]
        assert own[0, 1] == 0
        assert own[-1, 2] == len(rows)
        np.testing.assert_array_equal(own[1:, 1], own[:-1, 2])
