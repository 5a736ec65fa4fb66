"""Invariances of ground segmentation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.rotations import exp_rotation
from scanlock.segmentation.ground.finder import GroundFinder, GroundStatus, PublishedGroundFinder
from scanlock.segmentation.ground.model import BLUNT_THRESHOLD

pytestmark = pytest.mark.slow

_FINDER = GroundFinder()

seeds = st.integers(0, 2**32 - 1)


def _street(rng, slope):
    """Sloping plane with walls, of a point density that decreases with range."""
    radius = 3.0 * 12.0 ** rng.random(6000)
    azimuth = rng.uniform(-np.pi, np.pi, 6000)
    xy = [np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth)])]
    rise = [rng.normal(0, 0.01, 6000)]
    for _ in range(rng.integers(2, 6)):
        start, along = rng.uniform(-15, 15, 2), rng.uniform(-6, 6, 2)
        xy.append(start + rng.random((400, 1)) * along)
        rise.append(rng.uniform(0, 3, 400))
    xy = np.concatenate(xy)
    return np.column_stack([xy, slope * xy[:, 0] - 1.7 + np.concatenate(rise)])


def _find(points):
    return _FINDER.find(PointCloud.from_array(points))


def _assert_equal(first, second):
    """Two results agree, except for points within a centimetre of a threshold."""
    assert first.status is second.status
    is_clear = np.isfinite(first.height) == np.isfinite(second.height)
    for threshold in (_FINDER.height_threshold, BLUNT_THRESHOLD):
        is_clear &= ~(np.abs(np.abs(first.height) - threshold) < 0.01)
    assert is_clear.mean() > 0.9
    assert (first.is_ground == second.is_ground)[is_clear].all()


@settings(max_examples=15)
@given(seeds, st.floats(-0.08, 0.08), st.floats(-50, 50))
def test_a_translation_along_z_does_not_change_the_ground(seed, slope, shift):
    points = _street(np.random.default_rng(seed), slope)
    first, second = _find(points), _find(points + np.array([0, 0, shift]))
    _assert_equal(first, second)
    if first.status is not GroundStatus.NONE:
        expected = first.sensor_height - shift * first.up[2]
        assert np.isclose(second.sensor_height, expected, atol=1e-6)


def _rotated(points, sectors):
    angle = 2 * np.pi * sectors / _FINDER.grid.sectors
    return points @ exp_rotation(np.array([0.0, 0.0, angle])).T


@settings(max_examples=15)
@given(seeds, st.floats(-0.08, 0.08), st.integers(1, 29))
def test_a_rotation_by_whole_patches_does_not_change_the_ground(seed, slope, patches):
    points = _street(np.random.default_rng(seed), slope)
    _assert_equal(_find(points), _find(_rotated(points, 6 * patches)))


@settings(max_examples=15)
@given(seeds, st.floats(-0.08, 0.08), st.integers(1, 179))
def test_a_rotation_by_whole_sectors_changes_few_points(seed, slope, sectors):
    # Patches are six sectors wide and have other points after the rotation.
    points = _street(np.random.default_rng(seed), slope)
    first, second = _find(points), _find(_rotated(points, sectors))
    assert first.status is second.status
    assert (first.is_ground != second.is_ground).mean() < 0.005


@settings(max_examples=15)
@given(seeds, st.floats(-0.08, 0.08))
def test_the_order_of_rows_does_not_change_the_ground(seed, slope):
    rng = np.random.default_rng(seed)
    points = _street(rng, slope)
    order = rng.permutation(len(points))
    first, second = _find(points), _find(points[order])
    assert (first.is_ground[order] == second.is_ground).all()
    assert np.array_equal(first.height[order], second.height, equal_nan=True)


@settings(max_examples=15)
@given(seeds, st.integers(1, 300), st.floats(0.01, 300.0))
def test_any_cloud_has_a_complete_result(seed, count, size):
    rng = np.random.default_rng(seed)
    points = rng.normal(0, size, (count, 3)) * rng.choice([0.0, 0.01, 1.0], 3)
    for finder in (_FINDER, PublishedGroundFinder()):
        ground = finder.find(PointCloud.from_array(points))
        assert ground.is_ground.shape == ground.height.shape == (count,)
        assert not np.isnan(ground.height[ground.is_ground | ground.is_below]).any()
        assert np.isfinite(ground.up).all()
        assert ground.reason
        assert ground.is_ground.any() <= (ground.status is not GroundStatus.NONE)
