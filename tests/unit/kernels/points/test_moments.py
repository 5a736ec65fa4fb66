import numpy as np
import pytest

from reference.moments import moments
from scanlock.arrays import read_only
from scanlock.kernels.points.moments import labelled_means, labelled_moments

_ROWS, _COLUMNS = np.triu_indices(3)


def _labelled_moments(points, labels, clusters):
    return labelled_moments(read_only(points), read_only(labels), clusters)


@pytest.mark.parametrize("offset", [0.0, 9e3, -5e6])
def test_moments_match_the_definition(offset):
    rng = np.random.default_rng(3)
    points = rng.normal(0.0, [3.0, 1.0, 0.1], (400, 3)) + offset
    labels = rng.integers(-1, 6, 400)
    counts, means, packed = _labelled_moments(points, labels, 6)
    expected_counts, expected_means, expected = moments(points - offset, labels, 6)
    np.testing.assert_array_equal(counts, expected_counts)
    # Sums of hundreds of points near the offset round to a few units in its last place.
    rounding = 1e-13 + 300 * np.spacing(abs(offset))
    np.testing.assert_allclose(means - offset, expected_means, atol=rounding)
    np.testing.assert_allclose(packed, expected[:, _ROWS, _COLUMNS], atol=10 * rounding)


def test_empty_clusters_have_zero_moments_and_negative_labels_are_ignored():
    points = np.array([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [1e9, 1e9, 1e9]])
    counts, means, packed = _labelled_moments(points, np.array([2, 2, -1]), 4)
    np.testing.assert_array_equal(counts, [0, 0, 2, 0])
    np.testing.assert_array_equal(means[[0, 1, 3]], 0.0)
    np.testing.assert_array_equal(means[2], [2.0, 2.0, 2.0])
    np.testing.assert_array_equal(packed[2], [1.0, 0.0, -1.0, 0.0, 0.0, 1.0])
    assert not packed[[0, 1, 3]].any()


def test_no_points_and_no_clusters_give_empty_moments():
    counts, means, packed = _labelled_moments(np.empty((0, 3)), np.empty(0, np.int64), 0)
    assert counts.shape == (0,)
    assert means.shape == (0, 3)
    assert packed.shape == (0, 6)


def test_labelled_means_match_the_definition():
    rng = np.random.default_rng(4)
    points, labels = rng.normal(size=(90, 3)), rng.choice([-1, 0, 1, 3], 90)
    counts, means = labelled_means(read_only(points), read_only(labels), 4)
    expected_counts, expected_means, _ = moments(points, labels, 4)
    np.testing.assert_array_equal(counts, expected_counts)
    np.testing.assert_allclose(means, expected_means, atol=1e-13)
