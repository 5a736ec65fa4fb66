import numpy as np

from scanlock.arrays import read_only
from scanlock.kernels.points.surfaces import neighbour_covariances
from scanlock.models.gaussians import unpacked


def test_covariances_are_those_of_the_rows():
    rng = np.random.default_rng(10)
    points = rng.normal(size=(50, 3)) * [1.0, 5.0, 0.2] + [3e5, -4e6, 20.0]
    rows = rng.integers(0, 50, (40, 7))
    found = neighbour_covariances(read_only(points), read_only(rows))
    expected = np.array([np.cov(points[row].T, bias=True) for row in rows])
    np.testing.assert_allclose(unpacked(found), expected, rtol=1e-9, atol=1e-9)
