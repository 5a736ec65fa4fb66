import pickle

import numpy as np
import pytest

from reference import point_tree as reference
from reference.samples import street
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.errors import InvalidInput
from scanlock.kernels.points.leaf_covariances import knn_covariances


def _ring(rng, count):
    azimuth, radius = rng.uniform(0.0, 7.0, count), 3.0 + rng.exponential(20.0, count)
    return np.column_stack(
        [radius * np.cos(azimuth), radius * np.sin(azimuth), rng.normal(size=count)]
    )


def _lattice(rng, count):
    return rng.integers(0, 6, (count, 3)).astype(np.float64)


_CLOUDS = {
    "cube": lambda rng, n: rng.uniform(-20.0, 20.0, (n, 3)),
    "scan": _ring,
    "line": lambda rng, n: np.column_stack([rng.normal(size=n), np.zeros((n, 2))]),
    "plane": lambda rng, n: np.column_stack([rng.normal(size=(n, 2)), np.full(n, -1.7)]),
    "lattice with equal points": _lattice,
    "identical points": lambda rng, n: np.tile(rng.normal(size=3), (n, 1)),
    "sorted": lambda rng, n: np.sort(rng.normal(size=(n, 3)), axis=0),
    "map": lambda rng, n: rng.normal(size=(n, 3)) + np.array([5e5, 5.4e6, 100.0]),
}


@pytest.mark.parametrize("count", [1, 2, 16, 17, 33, 500])
@pytest.mark.parametrize("cloud", _CLOUDS)
def test_the_nearest_point_has_the_smallest_of_all_distances(cloud, count):
    rng = np.random.default_rng(count)
    points = _CLOUDS[cloud](rng, count)
    queries = np.concatenate([points + rng.normal(0.0, 0.5, points.shape), points, 3.0 * points])
    tree = PointTree.from_points(points)
    rows, distances = tree.nearest(queries)
    _, expected = reference.nearest(points, queries)
    np.testing.assert_allclose(distances, expected, rtol=1e-14, atol=1e-14)
    measured = np.linalg.norm(queries - tree.points[rows], axis=1)
    np.testing.assert_allclose(measured, expected, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("max_distance", [0.0, 0.3, 1.0, 1e3])
def test_points_beyond_the_maximum_distance_are_ignored(max_distance):
    rng = np.random.default_rng(0)
    points, queries = rng.uniform(-5.0, 5.0, (2, 400, 3))
    tree = PointTree.from_points(points)
    rows, distances = tree.nearest(queries, max_distance)
    expected_rows, expected = reference.nearest(points, queries, max_distance)
    np.testing.assert_array_equal(np.where(rows < 0, -1, tree.rows[rows]), expected_rows)
    np.testing.assert_allclose(distances, expected, rtol=1e-14)


def test_a_point_at_the_maximum_distance_is_ignored():
    tree = PointTree.from_points(np.zeros((1, 3)))
    queries = np.array([[0.0, 2.0, 0.0], [0.0, np.nextafter(2.0, 0.0), 0.0]])
    np.testing.assert_array_equal(tree.nearest(queries, 2.0)[0], [-1, 0])


@pytest.mark.parametrize("count", [1, 16, 17, 33, 500])
@pytest.mark.parametrize("cloud", _CLOUDS)
def test_neighbours_have_the_smallest_of_all_distances(cloud, count):
    points = _CLOUDS[cloud](np.random.default_rng(count), count)
    tree = PointTree.from_points(points)
    several = min(12, count)
    rows = tree.neighbours(several)
    measured = np.linalg.norm(tree.points[:, None] - tree.points[rows], axis=2)
    expected = np.sort(reference.distances(tree.points, tree.points), axis=1)[:, :several]
    np.testing.assert_allclose(measured, expected, rtol=1e-14, atol=1e-14)
    assert all(len(set(row)) == several for row in rows)


@pytest.mark.parametrize("count", [1, 9, 16, 17, 33, 500])
@pytest.mark.parametrize("cloud", [name for name in _CLOUDS if name != "lattice with equal points"])
def test_neighbour_covariances_are_those_of_the_neighbours(cloud, count):
    points = _CLOUDS[cloud](np.random.default_rng(count), count)
    tree = PointTree.from_points(points)
    several = min(9, count)
    order = np.argsort(reference.distances(tree.points, tree.points), axis=1)[:, :several]
    near = tree.points[order] - tree.points[:, None]
    centred = near - near.mean(axis=1, keepdims=True)
    expected = np.einsum("nka,nkb->nab", centred, centred)[:, *np.triu_indices(3)] / several
    size = (near**2).sum(axis=2).max(initial=0.0)
    assert (np.abs(tree.neighbour_covariances(several) - expected) <= 1e-13 * size).all()


@pytest.mark.parametrize("cloud", ["lattice with equal points", "identical points"])
def test_only_the_given_number_of_equidistant_neighbours_is_used(cloud):
    tree = PointTree.from_points(_CLOUDS[cloud](np.random.default_rng(4), 400))
    near = tree.points[tree.neighbours(9)] - tree.points[:, None]
    totals = near.var(axis=1).sum(axis=1)
    found = tree.neighbour_covariances(9)[:, [0, 3, 5]].sum(axis=1)
    # The choice among equidistant neighbours may differ, and with it their mean.
    assert (found <= (near**2).sum(axis=2).mean(axis=1) + 1e-12).all()
    np.testing.assert_allclose(found[totals == 0.0], 0.0, atol=1e-12)


def test_most_covariances_of_a_scan_need_no_neighbour_search():
    tree = PointTree.from_points(voxel_means(street(1), 0.25))
    _, is_known = knn_covariances(tree.points, tree.split_axes, tree.split_values, 10)
    assert is_known.mean() > 0.9


@pytest.mark.parametrize("cloud", _CLOUDS)
def test_rows_are_those_of_the_input_points(cloud):
    points = _CLOUDS[cloud](np.random.default_rng(1), 300)
    before = points.copy()
    tree = PointTree.from_points(points)
    np.testing.assert_array_equal(points, before)
    np.testing.assert_array_equal(np.sort(tree.rows), np.arange(300))
    np.testing.assert_array_equal(tree.points, points[tree.rows])


def test_neighbours_in_space_are_neighbours_in_memory():
    tree = PointTree.from_points(np.random.default_rng(2).uniform(0.0, 10.0, (4096, 3)))
    # 256 leaves of 16 points: a leaf is some 1.6 m wide, the cloud 10 m.
    leaves = tree.points.reshape(256, 16, 3)
    assert np.ptp(leaves, axis=1).max() < 4.0


def test_trees_are_read_only_and_pickle():
    tree = PointTree.from_points(np.random.default_rng(3).normal(size=(50, 3)))
    again = pickle.loads(pickle.dumps(tree))
    for name in ("points", "rows", "split_axes", "split_values"):
        np.testing.assert_array_equal(getattr(again, name), getattr(tree, name))
        assert not getattr(again, name).flags.writeable
    assert len(again) == 50


def test_an_empty_cloud_is_rejected():
    with pytest.raises(InvalidInput, match="points must contain at least one point, got none"):
        PointTree.from_points(np.empty((0, 3)))


@pytest.mark.parametrize("count", [0, 11, 2.5])
def test_invalid_counts_are_rejected(count):
    tree = PointTree.from_points(np.zeros((10, 3)))
    with pytest.raises(InvalidInput, match="count must be"):
        tree.neighbours(count)
    with pytest.raises(InvalidInput, match="count must be"):
        tree.neighbour_covariances(count)
