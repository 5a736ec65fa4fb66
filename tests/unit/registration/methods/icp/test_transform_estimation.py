import math

import numpy as np
import pytest
from scipy.optimize import minimize

from reference.point_scans import point_scan, unit_vectors
from reference.samples import rotated_covariances
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun
from scanlock.geometry.rotations import log_rotation
from scanlock.models.gaussians import unpacked
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.registration.methods.icp.correspondences import Correspondences
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation

_POSE = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.4, 0.9]))
_START = _POSE.retract(np.array([0.4, -0.3, 0.2, 0.05, -0.03, 0.08]))
_with_each_algorithm = pytest.mark.parametrize("algorithm", ["svd", "quaternion", "gauss-newton"])
_with_each_closed_form = pytest.mark.parametrize("algorithm", ["svd", "quaternion"])


def _packed(full):
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def _covariances(rng, count):
    return _packed(rotated_covariances(rng, rng.uniform(1e-4, 1e-2, (count, 3))))


def _pairs(rows, weights=None):
    count = len(rows[0])
    weights = np.ones(count) if weights is None else weights
    return Correspondences(
        np.array(rows[0]), np.array(rows[1]), np.full(count, 0.1), weights, threshold=1.0
    )


def _scans(noise=0.05, count=40, *, is_noisy=False):
    """Scans that match best near `_POSE`, with weighted correspondences of some of their points."""
    rng = np.random.default_rng(4)
    source = rng.uniform(-10.0, 10.0, (count + 5, 3))
    order = rng.permutation(len(source))
    target = _POSE.apply(source[order]) + rng.normal(0.0, noise, source.shape)
    sides = [
        point_scan(
            points,
            unit_vectors(rng, len(points)),
            _covariances(rng, len(points)) if is_noisy else None,
        )
        for points in (target, source)
    ]
    return *sides, _pairs((np.arange(count), order[:count]), rng.uniform(0.1, 1.0, count))


def _differences(target, source, pairs, pose):
    return pose.apply(source.points)[pairs.source_rows] - target.points[pairs.target_rows]


def _estimated(estimation, scans, constraints=UNCONSTRAINED, start=_START, steps=1):
    """The pose after some steps on the same correspondences, and the last note."""
    target, source, pairs = scans
    objective, pose, note = estimation.objective(target, source, pairs, start), start, ""
    for _ in range(steps):
        pose, note = estimation.next_pose(
            objective, constraints.applied_to(objective).linearise(pose), pose, constraints
        )
    return pose, note


@_with_each_algorithm
@pytest.mark.parametrize("deviation", [0.1, 0.5])
def test_the_objective_is_the_squared_distance_over_the_variance(algorithm, deviation):
    target, source, pairs = _scans()
    objective = TransformEstimation(algorithm=algorithm, sampling_deviation=deviation).objective(
        target, source, pairs, _START
    )
    squares = (_differences(target, source, pairs, _POSE) ** 2).sum(axis=1)
    expected = 0.5 * np.mean(pairs.weights * squares / deviation**2)
    # The weights are those of the start; the objective can be evaluated at any pose.
    assert objective.linearise(_POSE).value == pytest.approx(expected, rel=1e-12)
    assert objective.count == len(pairs)


def test_point_to_plane_residuals_are_along_the_normal_of_the_target():
    target, source, pairs = _scans()
    estimation = TransformEstimation(
        algorithm="gauss-newton", residual="point-to-plane", sampling_deviation=0.3
    )
    normals = target.normals[pairs.target_rows]
    offsets = (_differences(target, source, pairs, _POSE) * normals).sum(axis=1)
    expected = 0.5 * np.mean(pairs.weights * offsets**2) / 0.3**2
    found = estimation.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-12)


def _pair_covariances(target, source, pairs):
    """Covariance of the difference of each correspondence at the start."""
    rotated = _START.rotation @ unpacked(source.covariances) @ _START.rotation.T
    return unpacked(target.covariances)[pairs.target_rows] + rotated[pairs.source_rows]


@_with_each_closed_form
def test_closed_forms_weight_by_the_mean_variance(algorithm):
    target, source, pairs = _scans(is_noisy=True)
    found = TransformEstimation(algorithm=algorithm, sampling_deviation=0.05).objective(
        target, source, pairs, _START
    )
    squares = (_differences(target, source, pairs, _POSE) ** 2).sum(axis=1)
    variances = np.trace(_pair_covariances(target, source, pairs), axis1=1, axis2=2) / 3.0 + 0.05**2
    expected = 0.5 * np.mean(pairs.weights * squares / variances)
    assert found.linearise(_POSE).value == pytest.approx(expected, rel=1e-10)


def test_gauss_newton_weights_by_the_full_covariance():
    target, source, pairs = _scans(is_noisy=True)
    estimation = TransformEstimation(algorithm="gauss-newton", sampling_deviation=0.05)
    differences = _differences(target, source, pairs, _POSE)
    inverses = np.linalg.inv(_pair_covariances(target, source, pairs) + 0.05**2 * np.eye(3))
    expected = 0.5 * np.mean(
        pairs.weights * np.einsum("mi,mij,mj->m", differences, inverses, differences)
    )
    found = estimation.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-10)


def test_planes_weight_by_the_variance_along_the_normal():
    target, source, pairs = _scans(is_noisy=True)
    estimation = TransformEstimation(
        algorithm="gauss-newton", residual="point-to-plane", sampling_deviation=7.0
    )
    normals = target.normals[pairs.target_rows]
    offsets = (_differences(target, source, pairs, _POSE) * normals).sum(axis=1)
    both = _pair_covariances(target, source, pairs)
    variances = np.einsum("mi,mij,mj->m", normals, both, normals)
    expected = 0.5 * np.mean(pairs.weights * offsets**2 / variances)
    found = estimation.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-10)


@_with_each_closed_form
def test_a_closed_form_reaches_the_minimum_in_one_step(algorithm):
    target, source, pairs = _scans(noise=0.3)
    found, note = _estimated(TransformEstimation(algorithm=algorithm), (target, source, pairs))
    rows = target.points[pairs.target_rows], source.points[pairs.source_rows]
    expected = fit_arun(*rows, pairs.weights)
    assert note == ""
    assert found.is_close(expected, translation=1e-12, rotation=1e-12)
    # The weights change the minimum.
    assert found.distance(fit_arun(*rows))[0] > 1e-3
    clean, _ = _estimated(TransformEstimation(algorithm=algorithm), _scans(noise=0.0))
    assert clean.is_close(_POSE, translation=1e-12, rotation=1e-12)


def test_each_algorithm_uses_its_closed_form():
    target, source, pairs = _scans(noise=0.3)
    rows = target.points[pairs.target_rows], _START.apply(source.points[pairs.source_rows])
    objective = TransformEstimation().objective(target, source, pairs, _START)
    moments = PairMoments.of(*rows, objective.precisions[:, 0])
    # They differ by rounding only, so equality must be exact.
    forms = {"svd": moments.by_singular_values(), "quaternion": moments.by_quaternion()}
    assert forms["svd"] != forms["quaternion"]
    for algorithm, form in forms.items():
        assert (
            _estimated(TransformEstimation(algorithm=algorithm), (target, source, pairs))[0]
            == form @ _START
        )


def test_gauss_newton_converges_to_the_closed_form():
    scans = _scans(noise=0.3)
    closed, _ = _estimated(TransformEstimation(algorithm="svd"), scans)
    first, note = _estimated(TransformEstimation(algorithm="gauss-newton"), scans)
    assert note == ""
    assert first.distance(closed)[0] > 1e-4
    converged, _ = _estimated(TransformEstimation(algorithm="gauss-newton"), scans, steps=20)
    assert converged.is_close(closed, translation=1e-10, rotation=1e-11)


@_with_each_algorithm
def test_correspondences_of_zero_weight_have_no_effect(algorithm):
    target, source, pairs = _scans()
    weights = np.where(np.arange(len(pairs)) % 4 == 0, 0.0, pairs.weights)
    kept = weights > 0.0
    # They change the count of the mean, but not the minimum.
    some = _pairs((pairs.target_rows[kept], pairs.source_rows[kept]), weights[kept])
    all_pairs = _pairs((pairs.target_rows, pairs.source_rows), weights)
    found, expected = (
        _estimated(TransformEstimation(algorithm=algorithm), (target, source, one))[0]
        for one in (all_pairs, some)
    )
    assert found.is_close(expected, translation=1e-10, rotation=1e-10)


def test_point_to_plane_recovers_a_known_pose():
    scans = _scans(noise=0.0, count=60)
    estimation = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")
    found, note = _estimated(estimation, scans, steps=8)
    assert note == ""
    assert found.is_close(_POSE, translation=1e-9, rotation=1e-10)


def _best_of(dof, scans, start):
    """The minimising pose, by a search without derivatives over the free directions."""
    target, source, pairs = scans

    def pose(free):
        x, y, z, yaw = free if dof == "xyz+yaw" else (*free[:2], 0.0, free[2])
        return Pose.from_step(np.array([x, y, z, 0.0, 0.0, yaw])) @ start

    def cost(free):
        squares = (_differences(target, source, pairs, pose(free)) ** 2).sum(axis=1)
        return float(pairs.weights @ squares)

    first = np.zeros(4 if dof == "xyz+yaw" else 3)
    options = {"xatol": 1e-10, "fatol": 1e-14, "maxiter": 4000, "maxfev": 4000}
    return pose(minimize(cost, first, method="Nelder-Mead", options=options).x)


@pytest.mark.slow
@_with_each_algorithm
@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_locked_directions_are_unchanged_and_the_others_optimal(algorithm, dof):
    scans, constraints = _scans(noise=0.2), Constraints(dof=dof)
    found, note = _estimated(
        TransformEstimation(algorithm=algorithm),
        scans,
        constraints,
        steps=20 if algorithm == "gauss-newton" else 1,
    )
    assert note == ""
    expected = _best_of(dof, scans, _START)
    assert found.is_close(expected, translation=1e-6, rotation=1e-7)
    assert found.distance(_START)[0] > 0.1
    tilt = found.rotation @ _START.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-12)
    assert (dof == "xy+yaw") == (abs(found.translation[2] - _START.translation[2]) < 1e-12)


_ON_A_LINE = "correspondences on a line leave a rotation open: Gauss-Newton step instead"


@_with_each_closed_form
def test_correspondences_on_a_line_cause_no_rotation_about_it(algorithm):
    # Through the origin: a rotation about another line would include a translation.
    start = Pose(_START.rotation, np.zeros(3))
    truth = start.retract(np.array([0.4, -0.3, 0.2, 0.05, -0.03, 0.08]))
    source = np.linspace(-10.0, 10.0, 25)[:, None] * [0.0, 0.6, 0.8]
    rows = np.arange(25), np.arange(25)
    scans = point_scan(truth.apply(source)), point_scan(source), _pairs(rows)
    found, note = _estimated(TransformEstimation(algorithm=algorithm), scans, start=start)
    assert note == _ON_A_LINE
    turn = log_rotation(found.rotation @ start.rotation.T)
    assert abs(turn @ start.rotation @ [0.0, 0.6, 0.8]) < 1e-9
    assert np.linalg.norm(turn) > 0.05
    converged, _ = _estimated(TransformEstimation(algorithm=algorithm), scans, start=start, steps=8)
    np.testing.assert_allclose(_differences(*scans, converged), 0.0, atol=1e-9)


@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_correspondences_on_a_vertical_line_leave_yaw_open(dof):
    # Vertical in the frame of the target at the start.
    vertical = _START.inverse().apply(np.linspace(-2.0, 2.0, 25)[:, None] * [0.0, 0.0, 1.0])
    target = _START.apply(vertical) + np.array([0.3, 0.1, 0.2])
    scans = point_scan(target), point_scan(vertical), _pairs((np.arange(25), np.arange(25)))
    found, note = _estimated(TransformEstimation(), scans, Constraints(dof=dof))
    assert note == _ON_A_LINE
    assert found.distance(_START)[1] < 1e-9
    moved = found.translation - _START.translation
    np.testing.assert_allclose(moved, [0.3, 0.1, 0.2 if dof == "xyz+yaw" else 0.0], atol=1e-9)


@_with_each_closed_form
def test_a_prior_requires_gauss_newton_steps(algorithm):
    scans = _scans()
    constraints = Constraints(prior=PosePrior.from_deviations(_START, 0.01, 0.001))
    found, note = _estimated(TransformEstimation(algorithm=algorithm), scans, constraints, steps=3)
    assert note == "closed forms cannot include a prior: Gauss-Newton steps instead"
    newton, no_note = _estimated(
        TransformEstimation(algorithm="gauss-newton"), scans, constraints, steps=3
    )
    assert no_note == ""
    assert found == newton
    free, _ = _estimated(TransformEstimation(algorithm=algorithm), scans)
    assert free.distance(found)[0] > 0.1


def test_a_prior_is_weighted_against_the_sampling_deviation():
    scans = _scans()
    constraints = Constraints(prior=PosePrior.from_deviations(_START, 0.1, 0.01))
    precise, imprecise = (
        _estimated(
            TransformEstimation(algorithm="gauss-newton", sampling_deviation=one),
            scans,
            constraints,
            steps=10,
        )[0]
        for one in (1e-4, 1e3)
    )
    free, _ = _estimated(TransformEstimation(), scans)
    assert precise.is_close(free, translation=1e-3, rotation=1e-4)
    assert imprecise.is_close(_START, translation=1e-3, rotation=1e-4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"algorithm": "horn"},
            "algorithm must be one of svd, quaternion, gauss-newton, got 'horn'",
        ),
        ({"residual": "plane"}, "residual must be one of point-to-point, .*, got 'plane'"),
        ({"residual": "point-to-plane"}, "algorithm must be 'gauss-newton' .* form, got 'svd"),
        ({"residual": "point-to-plane", "algorithm": "quaternion"}, "form, got 'quaternion'"),
        ({"sampling_deviation": 0.0}, "sampling_deviation must be positive, got 0.0 m"),
        ({"rotation_scale": math.inf}, "rotation_scale must be positive, got inf m"),
    ],
)
def test_invalid_settings_raise(settings, message):
    with pytest.raises(InvalidInput, match=message):
        TransformEstimation(**settings)
