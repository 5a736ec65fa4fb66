import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import ground as slow
from scanlock.arrays import read_only
from scanlock.kernels.ground.dominant_planes import plane_sides, scored_triples
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


def test_triples_are_scored_with_their_better_side_up():
    rng = np.random.default_rng(6)
    points = rng.normal(0, 1, (300, 3)) * [10, 10, 1]
    weights, thresholds = rng.random(300), rng.uniform(0.2, 0.6, 300)
    columns = [read_only(np.ascontiguousarray(one)) for one in (*points.T, weights, 1 / thresholds)]
    triples = rng.integers(0, 300, (40, 3))
    triples[0] = 5
    found = scored_triples(*columns, read_only(triples), 200)
    expected = [
        slow.scored_triple(points, weights, thresholds, triple, 200) for triple in triples[1:]
    ]
    assert np.allclose(found[1:], expected, atol=1e-12)
    assert found[0, 4] == -np.inf
    on, below, above = plane_sides(*columns, *found[1, :4])
    score = slow.plane_score(points, weights, thresholds, found[1, :3], found[1, 3])
    assert on - 0.5 * below == pytest.approx(score)
    score = slow.plane_score(points, weights, thresholds, -found[1, :3], -found[1, 3])
    assert on - 0.5 * above == pytest.approx(score)


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
