"""Laws of the parts of ICP: closed forms agree, and so do all ways to find the nearest point."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanlock.clouds.neighbours import nearest_neighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun, fit_horn, fit_yaw

_coordinates = st.floats(-50.0, 50.0, width=32)
_steps = arrays(np.float64, 6, elements=st.floats(-3.0, 3.0))


@st.composite
def _weighted_pairs(draw):
    count = draw(st.integers(3, 20))
    source = draw(arrays(np.float64, (count, 3), elements=_coordinates))
    noise = draw(arrays(np.float64, (count, 3), elements=st.floats(-1.0, 1.0)))
    weights = draw(arrays(np.float64, count, elements=st.floats(0.01, 10.0)))
    return Pose.from_step(draw(_steps)).apply(source) + noise, source, weights


def _hold(moments):
    """Margin by which the best rotation beats the second best, of 1."""
    u, sizes, vt = np.linalg.svd(moments.cross_covariance)
    sign = np.sign(np.linalg.det(u @ vt))
    return (sizes[1] + sign * sizes[2]) / sizes[0] if sizes[0] > 0.0 else 0.0


@given(_weighted_pairs())
def test_singular_values_and_quaternion_give_one_pose(pairs):
    if (hold := _hold(PairMoments.of(*pairs))) > 1e-6:
        # What is held by little answers rounding with the inverse of that little.
        arun, horn = fit_arun(*pairs), fit_horn(*pairs)
        assert arun.is_close(horn, translation=1e-11 / hold, rotation=1e-13 / hold)


@given(_weighted_pairs())
def test_exchanging_the_sides_inverts_the_fit(pairs):
    target, source, weights = pairs
    if (hold := _hold(PairMoments.of(*pairs))) > 1e-6:
        there_and_back = fit_arun(target, source, weights) @ fit_arun(source, target, weights)
        assert there_and_back.is_close(
            Pose.identity(), translation=1e-11 / hold, rotation=1e-13 / hold
        )


@given(_weighted_pairs(), _steps, _steps)
def test_moving_either_side_moves_the_fit_with_it(pairs, left, right):
    target, source, weights = pairs
    if (hold := _hold(PairMoments.of(*pairs))) > 1e-6:
        a, b = Pose.from_step(left), Pose.from_step(right)
        moved = fit_arun(a.apply(target), b.apply(source), weights)
        expected = a @ fit_arun(target, source, weights) @ b.inverse()
        assert moved.is_close(expected, translation=1e-10 / hold, rotation=1e-12 / hold)


@given(_weighted_pairs(), st.floats(-3.0, 3.0))
def test_a_turn_about_z_turns_the_yaw_fit(pairs, angle):
    target, source, weights = pairs
    moments = PairMoments.of(*pairs)
    parts = np.hypot(
        moments.cross_covariance[0, 0] + moments.cross_covariance[1, 1],
        moments.cross_covariance[0, 1] - moments.cross_covariance[1, 0],
    )
    if parts > 1e-3:
        turn = Pose.from_step(np.array([0.0, 0.0, 0.0, 0.0, 0.0, angle]))
        moved = fit_yaw(turn.apply(target), source, weights)
        expected = turn @ fit_yaw(target, source, weights)
        assert moved.is_close(expected, translation=1e-7, rotation=1e-8)


@given(
    arrays(np.float64, st.tuples(st.integers(1, 60), st.just(3)), elements=_coordinates),
    arrays(np.float64, (20, 3), elements=st.floats(-200.0, 200.0)),
)
def test_tree_and_tessellation_find_the_same_distances(points, queries):
    tree = PointTree.from_points(points)
    _, by_tree = tree.nearest(queries)
    _, by_edges = nearest_neighbours(tree, "delaunay").nearest(queries)
    np.testing.assert_allclose(by_edges, by_tree, rtol=1e-12, atol=1e-12)


@given(st.integers(0, 10**6), st.integers(5, 200), st.sampled_from([1.0, 0.5, 0.1]))
def test_they_find_the_same_distances_where_points_repeat_a_lattice(seed, count, width):
    rng = np.random.default_rng(seed)
    points = width * rng.integers(0, 6, (count, 3))
    tree = PointTree.from_points(points)
    queries = width * np.concatenate(
        [rng.uniform(-3.0, 9.0, (50, 3)), 0.5 * rng.integers(-2, 14, (50, 3))]
    )
    _, by_tree = tree.nearest(queries)
    _, by_edges = nearest_neighbours(tree, "delaunay").nearest(queries)
    np.testing.assert_allclose(by_edges, by_tree, rtol=1e-12, atol=1e-12)
