import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import ground as slow
from scanlock.arrays import read_only
from scanlock.kernels.ground.plane import (
    plane_moments,
    plane_score,
    refined_plane,
    smallest_eigenvector,
    weighted_columns,
)


def test_plane_scores_and_moments_match_the_definition():
    rng = np.random.default_rng(5)
    low = rng.normal(0, 1, (400, 3)) * [10, 10, 0.5]
    weights, thresholds = rng.random(400), rng.uniform(0.2, 0.6, 400)
    normal = np.array([0.1, -0.05, 1.0]) / np.linalg.norm([0.1, -0.05, 1.0])
    columns = [read_only(column) for column in (*low.T, weights, 1 / thresholds)]
    measured = weighted_columns(read_only(low), 10.0, 0.2, 0.02)
    ranges = np.hypot(*low[:, :2].T)
    proximity = 1 / (10 + ranges)
    direct = [*low.T, proximity / proximity.sum(), 1 / (0.2 + 0.02 * ranges)]
    assert np.allclose(measured, direct, rtol=1e-13)
    found = plane_score(*columns, *normal, 0.1)
    assert found == pytest.approx(slow.plane_score(low, weights, thresholds, normal, 0.1))

    sums = plane_moments(*columns, 1.5, *normal, 0.1)
    mean = sums[1:4] / sums[0]
    xx, xy, xz, yy, yz, zz = sums[4:] / sums[0]
    scatter = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - np.outer(mean, mean)
    up = np.linalg.eigh(scatter)[1][:, 0]
    expected, offset = slow.biweight_plane(low, weights, thresholds, 1.5, normal, 0.1)
    assert np.allclose(up * np.sign(up[2]), expected, atol=1e-9)
    assert -(up * np.sign(up[2])) @ mean == pytest.approx(offset)
    once = refined_plane(*columns, read_only(np.array([1.5])), *normal, 0.1)
    assert np.allclose(once[:4], [*expected, offset], atol=1e-9)
    assert once[4] == pytest.approx(slow.plane_score(low, weights, thresholds, expected, offset))
    missed = refined_plane(*columns, read_only(np.array([1.5])), *normal, 90.0)
    assert missed[4] == -np.inf


@pytest.mark.slow
@given(
    arrays(np.float64, (6, 3), elements=st.floats(-3, 3)),
    st.sampled_from([1.0, 1e-9, 1e9]),
)
def test_the_flattest_direction_is_the_eigenvector_of_the_smallest_eigenvalue(rows, scale):
    scatter = rows.T @ rows * scale
    values, axes = np.linalg.eigh(scatter)
    found = np.array(smallest_eigenvector(scatter.copy()))
    assert np.linalg.norm(found) == pytest.approx(1)
    assert found[2] >= 0
    assert found @ scatter @ found == pytest.approx(values[0], abs=1e-13 * values[2])
    if values[1] - values[0] > 1e-3 * values[2]:
        assert abs(found @ axes[:, 0]) == pytest.approx(1)
