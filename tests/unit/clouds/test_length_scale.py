import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.samples import street
from scanlock.clouds.length_scale import LENGTH_SCALES, length_scale_of
from scanlock.clouds.point_cloud import PointCloud
from scanlock.kernels.points.crowding import crowded_counts


def _terrain(spacing, count=4000, seed=0):
    """Points of a plane with a density of one per squared spacing."""
    side = spacing * np.sqrt(count)
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-side / 2, side / 2, (count, 2)), np.zeros(count)])


def test_a_dense_scan_has_the_scale_one():
    cloud = PointCloud.from_array(street(1))
    assert not cloud.is_sparse
    assert cloud.length_scale == 1.0


@pytest.mark.parametrize("spacing", [0.5, 1.0, 2.0, 4.0])
def test_the_scale_follows_the_spacing(spacing):
    scale = PointCloud.from_array(_terrain(spacing)).length_scale
    twice = PointCloud.from_array(_terrain(2.0 * spacing)).length_scale
    assert scale in LENGTH_SCALES
    assert 1.3 * scale <= twice <= 2.7 * scale
    # A cube of the scale has the points of a Gaussian, within a factor of two.
    assert 2.0 < (scale / spacing) ** 2 < 16.0


def test_coordinates_times_a_power_of_two_have_a_larger_scale_by_that():
    cloud = _terrain(1.0)
    assert length_scale_of(4.0 * cloud) == 4.0 * length_scale_of(cloud)


def test_points_that_are_nowhere_crowded_have_the_scale_one():
    few = 1000.0 * np.random.default_rng(0).normal(size=(50, 3))
    cloud = PointCloud.from_array(few)
    assert cloud.is_sparse
    assert cloud.length_scale == 1.0


def test_blank_returns_do_not_count():
    cloud = np.concatenate([_terrain(2.0), np.zeros((3000, 3))])
    assert PointCloud.from_array(cloud).length_scale > 1.0


def test_a_scaled_cloud_has_units_of_its_scale():
    cloud = PointCloud.from_array(_terrain(1.0) + np.array([5e5, 4e6, 100.0]))
    scaled = cloud.scaled(4.0)
    assert scaled.scale == 4.0
    np.testing.assert_allclose(4.0 * scaled.points, cloud.points)
    np.testing.assert_allclose(scaled.centroid, cloud.centroid)
    assert scaled.radius == pytest.approx(cloud.radius)
    assert cloud.scaled(1.0) is cloud


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    size=st.floats(0.2, 3.0),
    min_points=st.integers(1, 8),
)
def test_crowded_points_are_counted_as_by_definition(seed, size, min_points):
    points = np.random.default_rng(seed).normal(0.0, 2.0, (300, 3))
    _, inverse, counts = np.unique(
        np.floor(points / size), axis=0, return_inverse=True, return_counts=True
    )
    expected = int((counts[inverse.ravel()] >= min_points).sum())
    crowded, total = crowded_counts(points, size, min_points, 1)
    assert total == 300
    # A point on the side of a voxel may round to its neighbour.
    assert abs(crowded - expected) <= 2


def test_a_sample_of_the_voxels_has_their_ratio():
    points = np.random.default_rng(0).uniform(-20.0, 20.0, (60_000, 3))
    whole = np.divide(*crowded_counts(points, 1.5, 4, 1))
    sampled = np.divide(*crowded_counts(points, 1.5, 4, 8))
    assert crowded_counts(points, 1.5, 4, 8)[1] == pytest.approx(60_000 / 8, rel=0.2)
    assert sampled == pytest.approx(whole, abs=0.05)
