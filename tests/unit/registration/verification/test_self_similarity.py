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
from scanlock.registration.verification.self_similarity import SelfSimilarity, self_matches


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


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_the_correlations_match_the_definition(turn):
    rng = np.random.default_rng(1)
    heights = np.arange(-1.5, 1.0, 0.2)
    points = np.array([(x, y, z) for x, y in rng.uniform(-15, 15, (12, 2)) for z in heights])
    similarity = _similarity(points)
    columns = occupied_columns(read_only(points), read_only(np.eye(3)), -2.0, 0.2, 400)
    view = reference.view_from_above(columns, 120, 2, 12)
    expected = reference.correlation(view, turn, 50)
    np.testing.assert_allclose(similarity.correlations[turn], expected, atol=1e-5)
    assert expected.max() > 0.05


def test_the_common_correlation_matches_the_definition():
    rng = np.random.default_rng(2)
    target, source = (ndimage.gaussian_filter(rng.random((21, 21)), 1.0) for _ in range(2))
    found = common_correlation(
        read_only(target), read_only(source), math.cos(0.4), math.sin(0.4), 1.5, -2.2
    )
    expected = reference.common_correlation(target, source, 0.4, (1.5, -2.2))
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_peaks_are_the_largest_values_of_their_squares():
    values = ndimage.gaussian_filter(np.random.default_rng(3).random((30, 30)), 1.0)
    found = peaks_above(read_only(values), 0.5, 2)
    highest = ndimage.maximum_filter(values, size=5) == values
    np.testing.assert_array_equal(found[:, :2], np.argwhere(highest & (values > 0.5)))
    np.testing.assert_array_equal(found[:, 2], values[highest & (values > 0.5)])


def _scattered(seed, count=25, half=20.0):
    rng = np.random.default_rng(seed)
    heights = np.arange(-1.5, 2.0, 0.1)
    return np.array([(x, y, z) for x, y in rng.uniform(-half, half, (count, 2)) for z in heights])


@pytest.mark.parametrize("yaw", [0.0, 1.1])
def test_a_row_of_posts_has_its_period(yaw):
    points, turn = _posts(6.0), exp_rotation(np.array([0.0, 0.0, yaw]))
    similarity, motions = self_matches(
        _similarity(points), _similarity(points @ turn), Pose(turn, np.zeros(3))
    )
    assert similarity > 0.3
    for period in (6.0, -6.0):
        expected = Pose(np.eye(3), np.array([period, 0.0, 0.0]))
        assert any(one.is_close(expected, translation=0.4, rotation=1e-6) for one in motions)


@pytest.mark.parametrize("turns", [1, 2])
def test_a_scene_that_equals_itself_turned_has_that_motion(turns):
    rng = np.random.default_rng(6)
    corner = np.vstack(
        [
            _scattered(7, count=5, half=7.0) + np.array([8.0 + x, 8.0 + y, 0.0])
            for x in (0.0, 0.4, 0.8)
            for y in (0.0, 0.4, 0.8)
        ]
    )
    quarter = exp_rotation(np.array([0.0, 0.0, 0.5 * math.pi]))
    copies = [corner]
    for _ in range(4 // turns - 1):
        copies.append(copies[-1] @ np.linalg.matrix_power(quarter, turns).T)
    scene = np.vstack(copies) + np.array([3.0, -2.0, 0.0])
    truth = Pose(exp_rotation(np.array([0.0, 0.0, 0.7])), np.array([2.0, 1.0, 0.0]))
    source = truth.inverse().apply(scene) + rng.normal(0.0, 0.005, scene.shape)
    similarity, motions = self_matches(_similarity(scene), _similarity(source), truth)
    assert similarity > 0.3
    rotation = np.linalg.matrix_power(quarter, turns)
    centre = np.array([3.0, -2.0, 0.0])
    expected = Pose(rotation, centre - rotation @ centre)
    for motion in (expected, expected.inverse()):
        assert any(one.is_close(motion, translation=0.6, rotation=1e-6) for one in motions)


def test_scattered_posts_have_no_self_match():
    similarity = _similarity(_scattered(4))
    value, motions = self_matches(similarity, similarity, Pose.identity())
    assert value == 0.0
    assert motions == ()


def test_a_period_of_one_scan_alone_is_none():
    value, _ = self_matches(_similarity(_posts(5.0)), _similarity(_scattered(5)), Pose.identity())
    assert value < 0.3


def test_a_long_object_is_no_period_of_itself():
    along, heights = np.arange(-4.0, 4.0, 0.1), np.arange(-1.5, 0.5, 0.1)
    wall = np.array([(x, 3.0 + 0.4 * x, z) for x in along for z in heights])
    similarity = _similarity(wall)
    _, motions = self_matches(similarity, similarity, Pose.identity())
    # Half a turn about its middle is a self-match.
    assert all(one.distance(Pose.identity())[1] > 3.0 for one in motions)


def test_an_empty_scan_has_no_self_match():
    empty = _similarity(np.zeros((0, 3)))
    value, motions = self_matches(empty, empty, Pose.identity())
    assert value == 0.0
    assert motions == ()
