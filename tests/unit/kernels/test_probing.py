import numpy as np
import pytest

from reference import probing as reference
from scanlock.arrays import read_only
from scanlock.kernels.probing import sums_near


@pytest.mark.parametrize("radius", [0.2, 0.5, 3.0])
@pytest.mark.parametrize("count", [1, 255, 256, 700])
def test_sums_match_the_definition(count, radius):
    rng = np.random.default_rng(count)
    points = rng.uniform(-4.0, 4.0, (count, 3))
    probes = rng.uniform(-5.0, 5.0, (60, 3))
    found = sums_near(read_only(points), read_only(probes), radius)
    expected = reference.sums_near(points, probes, radius)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    assert count < 255 or radius < 0.5 or expected[:, 0].max() > 0


def test_probes_in_one_place_and_far_from_zero_are_each_counted_once():
    # Few slots and equal cubes: lists are shared, and no point may be met twice.
    points = np.array([[1e6, -1e6, 3.0], [1e6 + 0.1, -1e6, 3.0], [1e6, -1e6, 9.0]])
    probes = np.repeat(points[:1], 5, axis=0)
    found = sums_near(read_only(points), read_only(probes), 0.5)
    np.testing.assert_allclose(found, reference.sums_near(points, probes, 0.5), atol=1e-9)
    assert (found[:, 0] == 2.0).all()


def test_nothing_is_near_no_points_and_no_probes():
    none, some = np.empty((0, 3)), np.zeros((4, 3))
    assert (sums_near(read_only(none), read_only(some), 0.5) == 0.0).all()
    assert sums_near(read_only(some), read_only(none), 0.5).shape == (0, 10)
