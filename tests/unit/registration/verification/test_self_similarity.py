"""Self-similarity of scans, against its definition and on rows of objects."""

import math

import numpy as np
import pytest
from scipy import ndimage

from reference import self_similarity as reference
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.verification.low_objects import occupied_columns
from scanlock.kernels.verification.self_similarity import (
    common_correlation,
    peaks_above,
    view_from_above,
)
from scanlock.registration.verification.low_objects import OccupiedColumns
from scanlock.registration.verification.self_similarity import SelfSimilarity, common_periods


def _similarity(points, rotation=None):
    rotation = read_only(np.eye(3) if rotation is None else rotation)
    columns = occupied_columns(read_only(points), rotation, -2.0, 0.2, 400)
    return SelfSimilarity.of(
        OccupiedColumns(columns=columns, rotation=rotation, base=-2.0, cell_size=0.2)
    )


def _posts(period, count=9, half_width=3.0):
    """Two rows of posts along x."""
    along = period * (np.arange(count) - count // 2)
    heights = np.arange(-1.5, 2.0, 0.1)
    return np.array([(x, y, z) for x in along for y in (-half_width, half_width) for z in heights])


def test_the_view_from_above_matches_the_definition():
    rng = np.random.default_rng(0)
    columns = occupied_columns(read_only(rng.normal(0, 2.0, (800, 3))), read_only(np.eye(3)),
                               -6.0, 0.2, 60)  # fmt: skip
    found = view_from_above(read_only(columns), 24, 2, 3)
    np.testing.assert_array_equal(found, reference.view_from_above(columns, 24, 2, 3))
    assert found.max() == 3


def test_the_autocorrelation_matches_the_definition():
    points = _posts(6.0) + np.random.default_rng(1).normal(0.0, 0.1, (1, 3))
    similarity = _similarity(points)
    columns = occupied_columns(read_only(points), read_only(np.eye(3)), -2.0, 0.2, 400)
    view = reference.view_from_above(columns, 120, 2, 12)
    expected = reference.autocorrelation(view, 50)
    np.testing.assert_allclose(similarity.correlation, expected, atol=1e-5)


def test_the_common_correlation_matches_the_definition():
    rng = np.random.default_rng(2)
    target, source = (ndimage.gaussian_filter(rng.random((21, 21)), 1.0) for _ in range(2))
    found = common_correlation(read_only(target), read_only(source), math.cos(0.4), math.sin(0.4))
    expected = reference.common_correlation(target, source, 0.4)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_peaks_are_the_largest_values_of_their_squares():
    values = ndimage.gaussian_filter(np.random.default_rng(3).random((30, 30)), 1.0)
    found = peaks_above(read_only(values), 0.5, 2)
    highest = ndimage.maximum_filter(values, size=5) == values
    np.testing.assert_array_equal(found[:, :2], np.argwhere(highest & (values > 0.5)))
    np.testing.assert_array_equal(found[:, 2], values[highest & (values > 0.5)])


@pytest.mark.parametrize("yaw", [0.0, 1.1])
def test_a_row_of_posts_has_its_period(yaw):
    points, turn = _posts(5.0), exp_rotation(np.array([0.0, 0.0, yaw]))
    similarity, periods = common_periods(
        _similarity(points), _similarity(points @ turn), Pose(turn, np.zeros(3))
    )
    # Posts of one cell lie on either side of the border of the next one.
    assert similarity > 0.3
    for period in (5.0, -5.0):
        assert np.linalg.norm(periods - [period, 0.0, 0.0], axis=1).min() < 0.4


def test_scattered_posts_have_no_period():
    rng = np.random.default_rng(4)
    heights = np.arange(-1.5, 2.0, 0.1)
    points = np.array([(x, y, z) for x, y in rng.uniform(-20, 20, (25, 2)) for z in heights])
    similarity = _similarity(points)
    value, _ = common_periods(similarity, similarity, Pose.identity())
    assert value < 0.3


def test_a_period_of_one_scan_alone_is_none():
    rng = np.random.default_rng(5)
    heights = np.arange(-1.5, 2.0, 0.1)
    scattered = np.array([(x, y, z) for x, y in rng.uniform(-20, 20, (25, 2)) for z in heights])
    value, _ = common_periods(_similarity(_posts(5.0)), _similarity(scattered), Pose.identity())
    assert value < 0.3


def test_a_long_object_is_no_period_of_itself():
    along, heights = np.arange(-4.0, 4.0, 0.1), np.arange(-1.5, 0.5, 0.1)
    wall = np.array([(x, 3.0, z) for x in along for z in heights])
    similarity = _similarity(wall)
    value, periods = common_periods(similarity, similarity, Pose.identity())
    assert value == 0.0
    assert len(periods) == 0


def test_an_empty_scan_matches_nothing():
    empty = _similarity(np.zeros((0, 3)))
    value, periods = common_periods(empty, empty, Pose.identity())
    assert value == 0.0
    assert periods.shape == (0, 3)
