import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference import point_tree as reference
from scanlock.arrays import read_only
from scanlock.clouds.cached_neighbours import CachedNeighbours, cached_neighbours
from scanlock.clouds.neighbours import closest_points
from scanlock.clouds.point_tree import PointTree
from scanlock.kernels.points.point_tree import kept_nearest_rows


def _assert_answers(kept, queries, limit):
    rows, distances = kept.nearest(queries, limit)
    _, expected = reference.nearest(kept.points, queries, limit)
    np.testing.assert_allclose(distances, expected, rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(rows < 0, np.isinf(expected))
    met = rows >= 0
    gaps = np.linalg.norm(queries[met] - kept.points[rows[met]], axis=1)
    np.testing.assert_allclose(gaps, expected[met], rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("limit", [np.inf, 2.0, 0.4])
@pytest.mark.parametrize("shrinking", [0.5, 0.9, 1.0])
def test_the_answers_are_those_of_all_distances_at_every_step(shrinking, limit):
    rng = np.random.default_rng(0)
    kept = CachedNeighbours(PointTree.from_points(rng.uniform(-5.0, 5.0, (600, 3))))
    queries, step = rng.uniform(-6.0, 6.0, (300, 3)), 0.5
    for _ in range(15):
        _assert_answers(kept, queries, limit)
        queries = queries + rng.normal(0.0, step, 3) + rng.normal(0.0, 0.1 * step, queries.shape)
        step *= shrinking


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    limits=st.lists(st.sampled_from([0.2, 0.7, 1.5, np.inf]), min_size=4, max_size=8),
    steps=st.lists(st.sampled_from([0.0, 1e-3, 0.03, 0.3]), min_size=8, max_size=8),
)
def test_limits_may_change_and_points_be_equal(seed, limits, steps):
    rng = np.random.default_rng(seed)
    lattice = rng.integers(0, 4, (60, 3)).astype(np.float64)
    kept = CachedNeighbours(PointTree.from_points(lattice))
    queries = rng.uniform(-1.0, 5.0, (40, 3))
    for limit, step in zip(limits, steps, strict=False):
        _assert_answers(kept, queries, limit)
        queries = queries + step * rng.normal(size=3)


def test_other_queries_begin_anew():
    rng = np.random.default_rng(1)
    kept = CachedNeighbours(PointTree.from_points(rng.normal(size=(100, 3))))
    for count in (30, 50, 0, 20):
        _assert_answers(kept, rng.normal(size=(count, 3)), 1.0)


def test_queries_that_hardly_move_are_not_searched_again():
    rng = np.random.default_rng(2)
    tree = PointTree.from_points(rng.uniform(-5.0, 5.0, (600, 3)))
    queries = rng.uniform(-5.0, 5.0, (200, 3))
    anchors, kept, bounds = queries.copy(), np.full(200, -1), np.full(200, -np.inf)
    searched, typical = [], 0.0
    for step in (0.0, 0.01, 0.003, 0.001):
        queries = read_only(queries + np.array([step, 0.0, 0.0]))
        _, _, typical = kept_nearest_rows(
            tree.points, tree.axes, tree.places, queries, 2.0, typical, anchors, kept, bounds
        )
        searched.append(np.mean((anchors == queries).all(axis=1)))
    assert searched[:2] == [1.0, 1.0]
    assert max(searched[2:]) < 0.2


def test_a_tessellation_stays_what_it_is():
    tree = PointTree.from_points(np.random.default_rng(3).normal(size=(50, 3)))
    tessellation = closest_points(tree, "delaunay")
    assert cached_neighbours(tessellation) is tessellation
    assert cached_neighbours(tree).points is tree.points
