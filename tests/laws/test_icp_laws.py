"""Laws of ICP: the closed forms agree, and so do the nearest-neighbour searches."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanlock.clouds.neighbours import nearest_neighbours
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun, fit_horn, fit_yaw

pytestmark = pytest.mark.slow

_coordinates = st.floats(-50.0, 50.0, width=32)
_steps = arrays(np.float64, 6, elements=st.floats(-3.0, 3.0))


@st.composite
def _weighted_pairs(draw):
    count = draw(st.integers(3, 20))
    source = draw(arrays(np.float64, (count, 3), elements=_coordinates))
    noise = draw(arrays(np.float64, (count, 3), elements=st.floats(-1.0, 1.0)))
    weights = draw(arrays(np.float64, count, elements=st.floats(0.01, 10.0)))
    return Pose.from_step(draw(_steps)).apply(source) + noise, source, weights


def _margin(moments):
    """Relative margin between the best and the second-best rotation, at most 1."""
    u, sizes, vt = np.linalg.svd(moments.cross_covariance)
    sign = np.sign(np.linalg.det(u @ vt))
    return (sizes[1] + sign * sizes[2]) / sizes[0] if sizes[0] > 0.0 else 0.0


@given(_weighted_pairs())
def test_singular_values_and_quaternion_give_the_same_pose(pairs):
    if (margin := _margin(PairMoments.of(*pairs))) > 1e-6:
        # Rounding errors are amplified by the inverse of the margin.
        arun, horn = fit_arun(*pairs), fit_horn(*pairs)
        assert arun.is_close(horn, translation=1e-11 / margin, rotation=1e-13 / margin)


@given(_weighted_pairs())
def test_swapping_target_and_source_inverts_the_fit(pairs):
    target, source, weights = pairs
    if (margin := _margin(PairMoments.of(*pairs))) > 1e-6:
        round_trip = fit_arun(target, source, weights) @ fit_arun(source, target, weights)
        assert round_trip.is_close(
            Pose.identity(), translation=1e-11 / margin, rotation=1e-13 / margin
        )


@given(_weighted_pairs(), _steps, _steps)
def test_the_fit_is_equivariant_to_motions_of_either_scan(pairs, left, right):
    target, source, weights = pairs
    if (margin := _margin(PairMoments.of(*pairs))) > 1e-6:
        a, b = Pose.from_step(left), Pose.from_step(right)
        moved = fit_arun(a.apply(target), b.apply(source), weights)
        expected = a @ fit_arun(target, source, weights) @ b.inverse()
        assert moved.is_close(expected, translation=1e-10 / margin, rotation=1e-12 / margin)


@given(_weighted_pairs(), st.floats(-3.0, 3.0))
def test_the_yaw_fit_is_equivariant_to_rotations_about_z(pairs, angle):
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
def test_tree_and_tessellation_agree_on_lattices_with_duplicates(seed, count, width):
    rng = np.random.default_rng(seed)
    points = width * rng.integers(0, 6, (count, 3))
    tree = PointTree.from_points(points)
    queries = width * np.concatenate(
        [rng.uniform(-3.0, 9.0, (50, 3)), 0.5 * rng.integers(-2, 14, (50, 3))]
    )
    _, by_tree = tree.nearest(queries)
    _, by_edges = nearest_neighbours(tree, "delaunay").nearest(queries)
    np.testing.assert_allclose(by_edges, by_tree, rtol=1e-12, atol=1e-12)
