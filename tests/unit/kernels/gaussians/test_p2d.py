import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.gaussians.p2d import bounding_balls, p2d_terms


def _terms(target, points, pose, *, end=25.0, exact=1.0, distance_factor=1.0):
    distances = distance_factor * np.sqrt(end * target.max_variances)
    points = read_only(np.array(points, float).reshape(-1, 3))
    return p2d_terms(
        points,
        read_only(bounding_balls(points)),
        read_only(np.column_stack([target.means, target.packed_precisions, distances])),
        pose.rotation,
        pose.translation,
        1.0,
        16.0,
        end,
        exact,
    )


# A block has 32 points, and eight blocks are tested together.
@pytest.mark.parametrize("count", [1, 31, 32, 33, 300, 700])
def test_the_value_is_the_sum_over_all_pairs(count):
    rng = np.random.default_rng(count)
    target = gaussians(rng, 40, half_width=6.0)
    points = rng.uniform(-12.0, 12.0, (count, 3))
    points[0] = target.means[0]
    pose = Pose.from_step(0.1 * rng.normal(size=6))
    expected = count * reference.p2d_value(pose, target, points)
    assert expected < 0.0
    np.testing.assert_allclose(_terms(target, points, pose)[0], expected, rtol=1e-11)


def test_the_distance_bound_is_exact_for_round_gaussians():
    # Blocks of equal points: the bound is the distance itself, so a shorter one changes the value.
    rng = np.random.default_rng(3)
    target = gaussians(rng, 50, min_deviation=1.0, max_deviation=1.0)
    points = np.repeat(rng.uniform(-12.0, 12.0, (40, 3)), 256, axis=0)
    value = _terms(target, points, Pose.identity())[0]
    expected = len(points) * reference.p2d_value(Pose.identity(), target, points)
    np.testing.assert_allclose(value, expected, rtol=1e-11)
    short = _terms(target, points, Pose.identity(), distance_factor=0.6)[0]
    assert abs(short / value - 1.0) > 1e-9


def test_the_order_of_the_points_changes_sums_by_rounding_only():
    rng = np.random.default_rng(4)
    target = gaussians(rng, 20, half_width=30.0)
    points = target.means[rng.integers(20, size=500)] + rng.normal(0.0, 1.0, (500, 3))
    pose = Pose.from_step(0.01 * rng.normal(size=6))
    one, other = (_terms(target, some, pose) for some in (points, points[rng.permutation(500)]))
    np.testing.assert_allclose(other, one, rtol=0.0, atol=1e-12 * np.abs(one).max())


def test_balls_enclose_their_points_tightly():
    rng = np.random.default_rng(5)
    points = rng.normal(0.0, 5.0, (100, 3))
    balls = bounding_balls(read_only(points))
    assert balls.shape == (4, 4)
    for ball, block in zip(balls, np.split(points, [32, 64, 96]), strict=True):
        np.testing.assert_allclose(ball[:3], block.mean(axis=0))
        offsets = np.linalg.norm(block - ball[:3], axis=1)
        assert ball[3] == pytest.approx(offsets.max())


def test_distant_points_and_empty_sets_have_zero_terms():
    rng = np.random.default_rng(10)
    some, none = gaussians(rng, 3, half_width=1.0), gaussians(rng, 0)
    far = [[1e3, 0.0, 0.0], [0.0, 0.0, -1e12]]
    for target, points in ((some, far), (none, far), (some, [])):
        np.testing.assert_array_equal(_terms(target, points, Pose.identity()), np.zeros(28))


def test_the_convex_hessian_is_the_gauss_newton_hessian():
    rng = np.random.default_rng(11)
    target = gaussians(rng, 6, half_width=2.0)
    points = rng.uniform(-3.0, 3.0, (40, 3))
    pose = Pose.from_step(0.1 * rng.normal(size=6))
    terms = _terms(target, points, pose, exact=0.0)
    expected = reference.p2d_gauss_newton(pose, target, points)
    np.testing.assert_allclose(terms[7:], expected[np.triu_indices(6)], rtol=1e-9, atol=1e-12)
