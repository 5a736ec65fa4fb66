import numpy as np
import pytest

from reference import grouping
from scanlock.arrays import read_only
from scanlock.kernels.ground.splitting import split_by_extent


def _cut(points, labels, parts, radius):
    """Labels and their number, of the runs that the kernel leaves."""
    rows, runs, _ = split_by_extent(
        read_only(points), read_only(labels), parts, read_only(np.array([float(radius)])), True
    )
    assert sorted(rows) == np.flatnonzero(labels >= 0).tolist()
    cut = np.full(len(points), -1)
    for part, (scale, begin, end) in enumerate(runs):
        assert scale == 0
        cut[rows[begin:end]] = part
    return cut, len(runs)


@pytest.mark.parametrize("radius", [0.8, 1.5, 4.0, 100.0])
def test_cuts_of_long_parts_match_the_definition(radius):
    # Walls and poles stay longer than wide at every cut, so their longest axis is clear; the
    # kernel need not find the axis of a round part to more than a few digits.
    rng = np.random.default_rng(8)
    walls = [rng.uniform(-0.5, 0.5, (150, 3)) * size for size in ([20, 0.2, 0.2], [0.1, 9, 0.1])]
    pole = rng.uniform(-0.5, 0.5, (150, 3)) * [0.1, 0.1, 7.0]
    points = np.concatenate([*walls, pole]) + rng.uniform(-30, 30, 3)
    labels = np.repeat([0, 1, 2], 150)
    cut, count = _cut(points, labels, 3, radius)
    expected = set()
    for part in range(3):
        expected |= grouping.pieces(points, np.flatnonzero(labels == part).tolist(), radius)
    assert grouping.partition(cut) == expected
    assert count == len(expected)


@pytest.mark.parametrize("count", [1, 2, 7, 300])
def test_identical_points_stay_together(count):
    points = np.tile([3.1, -0.7, 12.3], (count, 1))
    labels, parts = _cut(points, np.zeros(count, np.int64), 1, 1e-6)
    assert parts == 1
    np.testing.assert_array_equal(labels, 0)


@pytest.mark.parametrize("gap", [1e-3, 1.0, 1e9])
def test_two_points_part_only_when_each_is_too_far_from_their_mean(gap):
    points = np.array([[0.0, 0.0, 0.0], [gap, gap, 0.0]])
    half = np.sqrt(0.5) * gap
    together, count = _cut(points, np.zeros(2, np.int64), 1, 1.01 * half)
    assert (count, set(together)) == (1, {0})
    apart, count = _cut(points, np.zeros(2, np.int64), 1, 0.99 * half)
    assert (count, set(apart)) == (2, {0, 1})


def test_points_without_a_part_keep_none():
    labels = np.array([-1, 0, -1, 0])
    cut, count = _cut(np.arange(12.0).reshape(4, 3), labels, 1, 1.0)
    assert count == 2
    np.testing.assert_array_equal(cut < 0, labels < 0)


def test_parts_without_points_get_no_number():
    cut, count = _cut(np.zeros((2, 3)), np.array([3, 1]), 5, 1.0)
    assert count == 2
    assert sorted(cut) == [0, 1]


def test_moments_of_all_runs_at_all_radii_are_those_of_their_points():
    rng = np.random.default_rng(3)
    points = rng.normal(size=(700, 3)) * [20.0, 4.0, 1.0]
    labels = rng.integers(-1, 3, 700)
    radii = np.array([30.0, 5.0, 2.0, 0.5])
    arguments = read_only(points), read_only(labels), 3, read_only(radii)
    rows, runs, moments = split_by_extent(*arguments, True)
    none, same_runs, same_moments = split_by_extent(*arguments, False)
    assert len(none) == 0
    np.testing.assert_array_equal(same_runs, runs)
    np.testing.assert_array_equal(same_moments, moments)
    assert set(runs[:, 0]) == {0, 1, 2, 3}
    for (scale, begin, end), own in zip(runs, moments, strict=True):
        part = points[rows[begin:end]]
        assert np.linalg.norm(part - part.mean(axis=0), axis=1).max() <= radii[scale]
        covariance = np.cov(part.T, bias=True).reshape(3, 3)
        np.testing.assert_allclose(own[:3], part.mean(axis=0), atol=1e-12)
        np.testing.assert_allclose(own[3:], covariance[np.triu_indices(3)], atol=1e-12)
    for scale in range(4):
        own = runs[runs[:, 0] == scale]
        own = own[np.argsort(own[:, 1])]
        assert own[0, 1] == 0
        assert own[-1, 2] == len(rows)
        np.testing.assert_array_equal(own[1:, 1], own[:-1, 2])
