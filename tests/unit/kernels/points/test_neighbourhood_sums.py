import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import neighbourhood_sums as reference
from scanlock.arrays import read_only
from scanlock.kernels.points.neighbourhood_sums import sorted_by_voxel, sums_within_radius


def _sums_near(points, probes, radius, edge=1.0):
    ordered, starts = sorted_by_voxel(read_only(points), edge)
    return sums_within_radius(
        read_only(ordered), read_only(starts), edge, read_only(probes), radius
    )


@pytest.mark.parametrize("edge", [0.3, 1.0, 7.0])
@pytest.mark.parametrize("radius", [0.2, 0.5, 3.0])
@pytest.mark.parametrize("count", [1, 255, 256, 700])
def test_sums_match_the_definition(count, radius, edge):
    rng = np.random.default_rng(count)
    points = rng.uniform(-4.0, 4.0, (count, 3))
    probes = rng.uniform(-5.0, 5.0, (60, 3))
    found = _sums_near(points, probes, radius, edge)
    expected = reference.sums_within_radius(points, probes, radius)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert count < 255 or radius < 0.5 or expected[:, 0].max() > 0


def test_probes_in_one_place_and_far_from_zero_are_each_counted_once():
    # Few slots: cubes share them, and no point may be met twice.
    points = np.array([[1e6, -1e6, 3.0], [1e6 + 0.1, -1e6, 3.0], [1e6, -1e6, 9.0]])
    probes = np.repeat(points[:1], 5, axis=0)
    found = _sums_near(points, probes, 0.5)
    np.testing.assert_allclose(found, reference.sums_within_radius(points, probes, 0.5), atol=1e-9)
    assert (found[:, 0] == 2.0).all()


def test_nothing_is_near_no_points_and_no_probes():
    none, some = np.empty((0, 3)), np.zeros((4, 3))
    assert (_sums_near(none, some, 0.5) == 0.0).all()
    assert _sums_near(some, none, 0.5).shape == (0, 10)


@given(
    arrays(np.float64, (17, 3), elements=st.floats(-1e6, 1e6, width=32)),
    st.sampled_from([0.25, 1.0, 50.0]),
)
def test_points_are_sorted_by_cube_and_none_is_lost(points, edge):
    ordered, starts = sorted_by_voxel(read_only(points), edge)
    assert sorted(map(tuple, ordered)) == sorted(map(tuple, points))
    assert starts[0] == 0
    assert starts[-1] == len(points)
    slots = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    cubes = [tuple(cube) for cube in np.floor(ordered / edge)]
    for cube in set(cubes):
        assert len({slot for slot, one in zip(slots, cubes, strict=True) if one == cube}) == 1
