import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference import point_tree as reference
from scanlock.arrays import read_only
from scanlock.clouds.cached_neighbours import CachedNeighbours, cached_neighbours
from scanlock.clouds.neighbours import nearest_neighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.kernels.points.point_tree import cached_nearest_neighbours


def _assert_nearest(cached, queries, max_distance):
    rows, distances = cached.nearest(queries, max_distance)
    _, expected = reference.nearest(cached.points, queries, max_distance)
    np.testing.assert_allclose(distances, expected, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(rows < 0, np.isinf(expected))
    found = rows >= 0
    measured = np.linalg.norm(queries[found] - cached.points[rows[found]], axis=1)
    np.testing.assert_allclose(measured, expected[found], rtol=1e-13, atol=1e-13)


@pytest.mark.slow
@pytest.mark.parametrize("max_distance", [np.inf, 2.0, 0.4])
@pytest.mark.parametrize("shrinking", [0.5, 0.9, 1.0])
def test_the_result_is_exact_at_every_step(shrinking, max_distance):
    rng = np.random.default_rng(0)
    cached = CachedNeighbours(PointTree.from_points(rng.uniform(-5.0, 5.0, (600, 3))))
    queries, step = rng.uniform(-6.0, 6.0, (300, 3)), 0.5
    for _ in range(15):
        _assert_nearest(cached, queries, max_distance)
        queries = queries + rng.normal(0.0, step, 3) + rng.normal(0.0, 0.1 * step, queries.shape)
        step *= shrinking


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    thresholds=st.lists(st.sampled_from([0.2, 0.7, 1.5, np.inf]), min_size=4, max_size=8),
    steps=st.lists(st.sampled_from([0.0, 1e-3, 0.03, 0.3]), min_size=8, max_size=8),
)
def test_thresholds_may_change_and_points_may_be_equal(seed, thresholds, steps):
    rng = np.random.default_rng(seed)
    lattice = rng.integers(0, 4, (60, 3)).astype(np.float64)
    cached = CachedNeighbours(PointTree.from_points(lattice))
    queries = rng.uniform(-1.0, 5.0, (40, 3))
    for max_distance, step in zip(thresholds, steps, strict=False):
        _assert_nearest(cached, queries, max_distance)
        queries = queries + step * rng.normal(size=3)


def test_another_number_of_queries_resets_the_cache():
    rng = np.random.default_rng(1)
    cached = CachedNeighbours(PointTree.from_points(rng.normal(size=(100, 3))))
    for count in (30, 50, 0, 20):
        _assert_nearest(cached, rng.normal(size=(count, 3)), 1.0)


def test_queries_that_move_little_are_not_searched_again():
    rng = np.random.default_rng(2)
    tree = PointTree.from_points(rng.uniform(-5.0, 5.0, (600, 3)))
    queries = rng.uniform(-5.0, 5.0, (200, 3))
    anchors, rows, bounds = queries.copy(), np.full(200, -1), np.full(200, -np.inf)
    searched, typical = [], 0.0
    for step in (0.0, 0.01, 0.003, 0.001):
        queries = read_only(queries + np.array([step, 0.0, 0.0]))
        _, _, typical = cached_nearest_neighbours(
            tree.points, tree.split_axes, tree.split_values, queries, 2.0, typical,
            anchors, rows, bounds,
        )  # fmt: skip
        searched.append(np.mean((anchors == queries).all(axis=1)))
    assert searched[:2] == [1.0, 1.0]
    assert max(searched[2:]) < 0.2


def test_a_tessellation_is_not_cached():
    tree = PointTree.from_points(np.random.default_rng(3).normal(size=(50, 3)))
    tessellation = nearest_neighbours(tree, "delaunay")
    assert cached_neighbours(tessellation) is tessellation
    assert cached_neighbours(tree).points is tree.points
