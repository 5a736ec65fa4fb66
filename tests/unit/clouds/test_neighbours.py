import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import Delaunay

from reference import point_tree as reference
from reference.samples import street
from reference.tessellation import nearest_vertex
from scanlock.arrays import read_only
from scanlock.clouds.neighbours import Tessellation, nearest_neighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.kernels.points.tessellation import nearest_vertices


def _grid():
    return np.stack(np.meshgrid(*[np.arange(6.0)] * 3), axis=-1).reshape(-1, 3)


def _sphere(rng):
    points = rng.normal(size=(400, 3))
    return 5.0 * points / np.linalg.norm(points, axis=1)[:, None]


_CLOUDS = {
    "cube": lambda rng: rng.uniform(-20.0, 20.0, (500, 3)),
    "street": lambda rng: street(1, 2000),
    "grid": lambda rng: _grid(),
    "sphere": _sphere,
    "equal points": lambda rng: np.repeat(rng.uniform(-5.0, 5.0, (100, 3)), 3, axis=0),
    "identical points": lambda rng: np.full((50, 3), 2.5),
    "plane": lambda rng: np.column_stack([rng.normal(size=(300, 2)), np.full(300, -1.7)]),
    "line": lambda rng: np.arange(40.0)[:, None] * [1.0, 2.0, 0.5],
    "thin plane": lambda rng: rng.normal(size=(300, 3)) * [5.0, 5.0, 1e-9],
    "one point": lambda rng: rng.normal(size=(1, 3)),
    "four points": lambda rng: rng.normal(size=(4, 3)),
    "map": lambda rng: rng.normal(0.0, 20.0, (300, 3)) + np.array([5e5, 5e6, 100.0]),
    "an outlier": lambda rng: np.vstack([street(1, 1000), [1e6, 1e6, 0.0]]),
    "a distant outlier": lambda rng: np.vstack([street(1, 1000), [1e12, 1e12, 1e12]]),
}


@pytest.mark.slow
@pytest.mark.parametrize("cloud", _CLOUDS)
def test_the_tessellation_finds_the_nearest_point(cloud):
    rng = np.random.default_rng(0)
    points = _CLOUDS[cloud](rng)
    middle = np.median(points, axis=0)
    queries = np.concatenate(
        [points + rng.normal(0.0, 0.5, points.shape), points, middle + 3.0 * (points - middle)]
    )
    found = Tessellation.from_points(points)
    rows, distances = found.nearest(queries)
    _, expected = reference.nearest(points, queries)
    np.testing.assert_allclose(distances, expected, rtol=1e-12, atol=1e-12)
    measured = np.linalg.norm(queries - points[rows], axis=1)
    np.testing.assert_allclose(measured, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("cloud", ["cube", "street", "sphere"])
def test_clouds_with_volume_need_no_tree(cloud):
    assert Tessellation.from_points(_CLOUDS[cloud](np.random.default_rng(0))).rest is None


def test_coplanar_points_are_searched_in_a_tree():
    points = _CLOUDS["plane"](np.random.default_rng(0))
    assert len(Tessellation.from_points(points).left_out) == len(points)


@pytest.mark.parametrize("entry", [0, 7, 299])
def test_the_kernel_follows_its_definition(entry):
    rng = np.random.default_rng(1)
    points = rng.uniform(-5.0, 5.0, (300, 3))
    queries = rng.uniform(-10.0, 10.0, (100, 3))
    starts, neighbours = Delaunay(points).vertex_neighbor_vertices
    edges = [neighbours[a:b] for a, b in pairwise(starts)]
    rows, distances = nearest_vertices(
        read_only(points),
        read_only(starts.astype(np.int64)),
        read_only(neighbours.astype(np.int64)),
        read_only(queries),
        entry,
    )
    expected = [nearest_vertex(points, edges, query, entry) for query in queries]
    np.testing.assert_array_equal(rows, [row for row, _ in expected])
    np.testing.assert_allclose(distances, [distance for _, distance in expected], rtol=1e-14)


@pytest.mark.parametrize("max_distance", [0.0, 0.3, 1.0, 1e3])
@pytest.mark.parametrize("search", ["k-d tree", "delaunay"])
def test_points_beyond_the_maximum_distance_are_ignored(search, max_distance):
    rng = np.random.default_rng(0)
    points, queries = rng.uniform(-5.0, 5.0, (2, 400, 3))
    tree = PointTree.from_points(points)
    found = nearest_neighbours(tree, search)
    rows, distances = found.nearest(queries, max_distance)
    expected_rows, expected = reference.nearest(tree.points, queries, max_distance)
    np.testing.assert_array_equal(rows, expected_rows)
    np.testing.assert_allclose(distances, expected, rtol=1e-14)
    np.testing.assert_array_equal(found.points, tree.points)


def test_a_pickled_tessellation_gives_the_same_results():
    found = Tessellation.from_points(street(1, 500))
    again = pickle.loads(pickle.dumps(found))
    for mine, other in zip(found.nearest(street(2, 50)), again.nearest(street(2, 50)), strict=True):
        np.testing.assert_array_equal(mine, other)


def test_invalid_input_is_rejected():
    with pytest.raises(InvalidInput, match="at least one point"):
        Tessellation.from_points(np.empty((0, 3)))
    with pytest.raises(InvalidInput, match="search must be 'k-d tree' or 'delaunay', got 'octree'"):
        nearest_neighbours(PointTree.from_points(np.eye(3)), "octree")
