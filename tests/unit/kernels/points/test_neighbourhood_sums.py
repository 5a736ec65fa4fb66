import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import neighbourhood_sums as reference
from scanlock.arrays import read_only
from scanlock.kernels.points.neighbourhood_sums import sorted_by_voxel, sums_within_radius


def _sums(points, queries, radius, edge=1.0):
    ordered, starts = sorted_by_voxel(read_only(points), edge)
    return sums_within_radius(
        read_only(ordered), read_only(starts), edge, read_only(queries), radius
    )


@pytest.mark.slow
@pytest.mark.parametrize("edge", [0.3, 1.0, 7.0])
@pytest.mark.parametrize("radius", [0.2, 0.5, 3.0])
@pytest.mark.parametrize("count", [1, 255, 256, 700])
def test_sums_match_the_definition(count, radius, edge):
    rng = np.random.default_rng(count)
    points = rng.uniform(-4.0, 4.0, (count, 3))
    queries = rng.uniform(-5.0, 5.0, (60, 3))
    found = _sums(points, queries, radius, edge)
    expected = reference.sums_within_radius(points, queries, radius)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert count < 255 or radius < 0.5 or expected[:, 0].max() > 0


def test_equal_queries_far_from_the_origin_have_equal_sums():
    # Voxels share the few slots, and every point counts once.
    points = np.array([[1e6, -1e6, 3.0], [1e6 + 0.1, -1e6, 3.0], [1e6, -1e6, 9.0]])
    queries = np.repeat(points[:1], 5, axis=0)
    found = _sums(points, queries, 0.5)
    np.testing.assert_allclose(found, reference.sums_within_radius(points, queries, 0.5), atol=1e-9)
    assert (found[:, 0] == 2.0).all()


def test_no_points_and_no_queries_have_no_sums():
    none, some = np.empty((0, 3)), np.zeros((4, 3))
    assert (_sums(none, some, 0.5) == 0.0).all()
    assert _sums(some, none, 0.5).shape == (0, 10)


@given(
    arrays(np.float64, (17, 3), elements=st.floats(-1e6, 1e6, width=32)),
    st.sampled_from([0.25, 1.0, 50.0]),
)
def test_points_are_sorted_by_voxel_and_all_are_kept(points, edge):
    ordered, starts = sorted_by_voxel(read_only(points), edge)
    assert sorted(map(tuple, ordered)) == sorted(map(tuple, points))
    assert starts[0] == 0
    assert starts[-1] == len(points)
    slots = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    voxels = [tuple(voxel) for voxel in np.floor(ordered / edge)]
    for voxel in set(voxels):
        assert len({slot for slot, one in zip(slots, voxels, strict=True) if one == voxel}) == 1
