import numpy as np
import pytest

from scanlock.kernels.simulation.ray_tree import box_tree


def _boxes(rng, count):
    low = rng.uniform(-50, 50, (count, 3))
    return np.column_stack([low, low + rng.exponential(1.0, (count, 3))])


def _leaves(bounds, node_bounds, link, count, order, node=0):
    """All rows below a node, after a check that its box is their bounding box."""
    if count[node]:
        rows = list(order[link[node] : link[node] + count[node]])
    else:
        assert link[node] > node + 1
        rows = [
            *_leaves(bounds, node_bounds, link, count, order, node + 1),
            *_leaves(bounds, node_bounds, link, count, order, link[node]),
        ]
    assert np.array_equal(node_bounds[node, :3], bounds[rows, :3].min(axis=0))
    assert np.array_equal(node_bounds[node, 3:], bounds[rows, 3:].max(axis=0))
    return rows


@pytest.mark.parametrize("count", [1, 2, 4, 5, 6, 17, 300])
def test_every_box_is_in_one_leaf_inside_its_parent_nodes(count):
    bounds = _boxes(np.random.default_rng(count), count)
    order, *nodes = box_tree(bounds)
    assert sorted(_leaves(bounds, *nodes, order)) == list(range(count))


def test_boxes_with_equal_centres_are_split():
    bounds = np.tile([-1.0, -1, -1, 1, 1, 1], (50, 1))
    order, node_bounds, link, count = box_tree(bounds)
    assert count.max() <= 4
    assert sorted(_leaves(bounds, node_bounds, link, count, order)) == list(range(50))


def test_the_depth_of_a_tree_of_scattered_boxes_is_bounded():
    bounds = _boxes(np.random.default_rng(0), 4000)
    _, _, link, count = box_tree(bounds)
    depth = np.zeros(len(count), int)
    for node in range(len(count)):
        if not count[node]:
            depth[[node + 1, link[node]]] = depth[node] + 1
    assert depth.max() < 30


def test_no_boxes_give_no_nodes():
    assert [len(array) for array in box_tree(np.empty((0, 6)))] == [0, 0, 0, 0]
