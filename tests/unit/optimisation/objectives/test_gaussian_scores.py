import numpy as np
import pytest

from reference import differences
from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import (
    GaussiansToGaussians,
    PointsToGaussians,
    ScoreShape,
)


def _round(means, deviation=1.0):
    means = np.array(means, float)
    return Gaussians.from_covariances(
        means, np.tile(deviation**2 * np.eye(3), (len(means), 1, 1)), np.ones(len(means), np.int64)
    )


def _p2d(target, points, **shape):
    return PointsToGaussians(
        target=target, points=read_only(np.array(points, float)), shape=ScoreShape(**shape)
    )


@pytest.mark.parametrize(
    "shape", [{}, {"sharpness": 0.2}, {"window_start": 1.0, "window_end": 4.0}]
)
@pytest.mark.parametrize("seed", range(3))
def test_values_match_the_definition(seed, shape):
    rng = np.random.default_rng(seed)
    target, source = gaussians(rng, 40), gaussians(rng, 30)
    points = rng.uniform(-12.0, 12.0, (200, 3))
    pose = Pose.from_step(rng.normal(size=6))
    given = {"sharpness": 1.0, "window_start": 16.0, "window_end": 25.0} | shape
    plain = {
        "sharpness": given["sharpness"],
        "start": given["window_start"],
        "end": given["window_end"],
    }
    d2d = GaussiansToGaussians(target=target, source=source, shape=ScoreShape(**shape))
    np.testing.assert_allclose(
        d2d.linearise(pose).value, reference.d2d_value(pose, target, source, **plain), rtol=1e-12
    )
    np.testing.assert_allclose(
        _p2d(target, points, **shape).linearise(pose).value,
        reference.p2d_value(pose, target, points, **plain),
        rtol=1e-11,
    )


@pytest.mark.parametrize(
    "target",
    [
        _round([[0.0, 0.0, 0.0]]),
        _round([[0.0, 0.0, 0.0]], deviation=40.0),
        _round([[0.0, 0.0, 0.0], [20_000.0, -3.0, 0.0]]),
        _round([[-7.5, 12.0, 100.0], [-7.5, 12.0, -100.0]]),
        _round([[7000.0, 5000.0, 0.0], [7001.0, 5003.0, 0.0]]),
        gaussians(
            np.random.default_rng(1), 50, half_width=300.0, min_deviation=0.1, max_deviation=30.0
        ),
    ],
    ids=["one", "one wide", "far apart", "stacked", "off the origin", "many sizes"],
)
def test_no_point_is_left_out(target):
    rng = np.random.default_rng(2)
    corner = (target.means[:, :2] - 5.0 * np.sqrt(target.max_variances)[:, None]).min(axis=0)
    # Points near each Gaussian, on a regular grid and far outside.
    near = target.means[rng.integers(len(target), size=300)]
    near = near + rng.normal(size=near.shape) * 2.0 * np.sqrt(target.max_variances.max())
    columns, rows = np.meshgrid(np.arange(-2.0, 12.0), np.arange(-2.0, 12.0))
    on_edges = np.column_stack([columns.ravel(), rows.ravel(), np.zeros(columns.size)])
    on_edges = np.append(corner, target.means[0, 2]) + 3.0 * on_edges
    on_means = target.means
    points = np.concatenate([near, on_edges, on_means, on_means + np.array([1e7, -1e7, 0.0])])
    expected = reference.p2d_value(Pose.identity(), target, points)
    assert expected < 0.0
    value = _p2d(target, points).linearise(Pose.identity()).value
    np.testing.assert_allclose(value, expected, rtol=1e-11)


def test_p2d_is_continuous_where_the_score_of_the_own_cell_jumps():
    # Two Gaussians in neighbouring cells of 2 m; a point moves from one cell into the other.
    target = _round([[1.5, 1.0, 1.0], [3.5, 1.0, 1.0]], deviation=0.5)
    point = np.array([[0.0, 1.0, 1.0]])
    steps = 1e-4
    positions = np.arange(1.9, 2.1, steps)
    poses = [Pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in positions]
    own = np.array([reference.own_cell_value(pose, target, point, 2.0) for pose in poses])
    every = np.array([_p2d(target, point).linearise(pose).value for pose in poses])
    assert np.abs(np.diff(own)).max() > 0.5
    # |d rho / dx| of one Gaussian is at most exp(-1/2) over its deviation.
    assert np.abs(np.diff(every)).max() < 2.0 * np.exp(-0.5) / 0.5 * steps


@pytest.mark.parametrize("fraction", [0.2, 0.5, 0.8])
def test_derivatives_match_differences_where_the_window_falls(fraction):
    # The default window starts where a score is e^-8; this one falls where the score is large.
    rng = np.random.default_rng(5)
    shape = ScoreShape(sharpness=0.5, window_start=1.0, window_end=9.0)
    target, source = gaussians(rng, 1, min_deviation=0.5), gaussians(rng, 1, min_deviation=0.5)
    pose = Pose.from_step(rng.normal(size=6))
    for objective, both in (
        (
            GaussiansToGaussians(target=target, source=source, shape=shape),
            target.covariances[0] + source.transformed(pose).covariances[0],
        ),
        (
            PointsToGaussians(target=target, points=source.means, shape=shape),
            target.covariances[0],
        ),
    ):
        # A source at this squared distance, inside the window.
        s = 1.0 + fraction * 8.0
        position = target.means[0] + np.linalg.cholesky(both) @ np.array([0.6, 0.0, 0.8]) * np.sqrt(
            s
        )
        at = Pose(pose.rotation, position - pose.rotation @ source.means[0])
        found = objective.linearise(at)
        # Far from both ends the function is smooth: the stencil errs by h^4 and rounding over h.
        h = 1e-3 * np.array([1.0, 1.0, 1.0, 0.05, 0.05, 0.05])
        gradient = differences.gradient(lambda p, o=objective: o.linearise(p).value, at, h)
        hessian = differences.hessian(lambda p, o=objective: o.linearise(p).gradient, at, h)
        assert np.abs(found.gradient).max() > 1e-3
        np.testing.assert_allclose(found.gradient, gradient, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(found.hessian, hessian, rtol=1e-6, atol=1e-7)


def test_values_are_means_over_the_points():
    target = _round([[0.0, 0.0, 0.0]])
    once = _p2d(target, [[0.0, 0.0, 0.0]]).linearise(Pose.identity())
    assert once.value == -1.0
    half = _p2d(target, [[0.0, 0.0, 0.0], [50.0, 0.0, 0.0]]).linearise(Pose.identity())
    assert half.value == -0.5
    np.testing.assert_array_equal(once.gradient, 0.0)


def test_identical_scans_are_stationary_for_d2d():
    some = gaussians(np.random.default_rng(3), 30)
    at = GaussiansToGaussians(target=some, source=some).linearise(Pose.identity())
    np.testing.assert_allclose(at.gradient, 0.0, atol=1e-14)


def test_scans_without_overlap_give_a_zero_quadratic():
    target, source = _round([[0.0, 0.0, 0.0]]), _round([[0.0, 0.0, 100.0]])
    for objective in (
        GaussiansToGaussians(target=target, source=source),
        _p2d(target, source.means),
        _p2d(target, source.means[:, ::-1]),
    ):
        at = objective.linearise(Pose.identity())
        assert at.value == 0.0
        np.testing.assert_array_equal(at.gradient, np.zeros(6))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sharpness": 0.0}, "sharpness must be positive"),
        ({"window_start": -1.0}, "window_start must be positive"),
        ({"window_end": 16.0}, "window_end must be"),
        ({"window_end": float("nan")}, "window_end must be"),
    ],
)
def test_shapes_out_of_range_are_rejected_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        ScoreShape(**settings)
