import math

import numpy as np
import pytest
from scipy.optimize import minimize

from reference.point_scans import point_scan, unit_vectors
from reference.samples import turned_covariances
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import PairMoments, fit_arun
from scanlock.geometry.rotations import log_rotation
from scanlock.models.gaussians import unpacked
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.registration.methods.correspondences import Correspondences
from scanlock.registration.methods.transform_estimation import TransformEstimation

_POSE = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.4, 0.9]))
_START = _POSE.retract(np.array([0.4, -0.3, 0.2, 0.05, -0.03, 0.08]))
_STEPS = ("svd", "quaternion", "gauss-newton")
_with_each_step = pytest.mark.parametrize("step", _STEPS)
_with_each_closed_form = pytest.mark.parametrize("step", ["svd", "quaternion"])


def _packed(full):
    return full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]


def _covariances(rng, count):
    return _packed(turned_covariances(rng, rng.uniform(1e-4, 1e-2, (count, 3))))


def _pairs(rows, weights=None):
    return Correspondences(
        np.array(rows[0]), np.array(rows[1]), np.ones(len(rows[0])) if weights is None else weights,
        0.1, 1.0,
    )  # fmt: skip


def _scene(noise=0.05, count=40, *, is_noisy=False):
    """Scans whose pairs fit best near `_POSE`, with weights; some points have no partner."""
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


def _gaps(target, source, pairs, pose):
    return pose.apply(source.points)[pairs.source_rows] - target.points[pairs.target_rows]


def _fitted(fit, scene, constraints=UNCONSTRAINED, start=_START, steps=1):
    """Where some steps on the same pairs lead, and the last note."""
    target, source, pairs = scene
    objective, pose, note = fit.objective(target, source, pairs, start), start, ""
    for _ in range(steps):
        pose, note = fit.next_pose(
            objective, constraints.applied_to(objective).linearise(pose), pose, constraints
        )
    return pose, note


@_with_each_step
@pytest.mark.parametrize("deviation", [0.1, 0.5])
def test_distances_cost_their_squares_over_the_variance(step, deviation):
    target, source, pairs = _scene()
    objective = TransformEstimation(algorithm=step, sampling_deviation=deviation).objective(
        target, source, pairs, _START
    )
    squares = (_gaps(target, source, pairs, _POSE) ** 2).sum(axis=1)
    expected = 0.5 * np.mean(pairs.weights * squares / deviation**2)
    # The weights are settled where the pairs were made; the cost is that of any pose.
    assert objective.linearise(_POSE).value == pytest.approx(expected, rel=1e-12)
    assert objective.count == len(pairs)


def test_planes_cost_only_what_lies_along_the_normal_of_the_target():
    target, source, pairs = _scene()
    fit = TransformEstimation(
        algorithm="gauss-newton", residual="point-to-plane", sampling_deviation=0.3
    )
    normals = target.normals[pairs.target_rows]
    offsets = (_gaps(target, source, pairs, _POSE) * normals).sum(axis=1)
    expected = 0.5 * np.mean(pairs.weights * offsets**2) / 0.3**2
    found = fit.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-12)


def _pair_covariances(target, source, pairs):
    """Of each pair's difference, where the pairs were made."""
    turned = _START.rotation @ unpacked(source.covariances) @ _START.rotation.T
    return unpacked(target.covariances)[pairs.target_rows] + turned[pairs.source_rows]


@_with_each_closed_form
def test_closed_forms_weigh_noise_and_sampling_by_their_mean_variance(step):
    target, source, pairs = _scene(is_noisy=True)
    found = TransformEstimation(algorithm=step, sampling_deviation=0.05).objective(
        target, source, pairs, _START
    )
    squares = (_gaps(target, source, pairs, _POSE) ** 2).sum(axis=1)
    variances = np.trace(_pair_covariances(target, source, pairs), axis1=1, axis2=2) / 3.0 + 0.05**2
    expected = 0.5 * np.mean(pairs.weights * squares / variances)
    assert found.linearise(_POSE).value == pytest.approx(expected, rel=1e-10)


def test_gauss_and_newton_weigh_noise_and_sampling_by_the_whole_covariance():
    target, source, pairs = _scene(is_noisy=True)
    fit = TransformEstimation(algorithm="gauss-newton", sampling_deviation=0.05)
    gaps = _gaps(target, source, pairs, _POSE)
    inverses = np.linalg.inv(_pair_covariances(target, source, pairs) + 0.05**2 * np.eye(3))
    expected = 0.5 * np.mean(pairs.weights * np.einsum("mi,mij,mj->m", gaps, inverses, gaps))
    found = fit.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-10)


def test_planes_weigh_noise_by_its_variance_along_the_normal():
    target, source, pairs = _scene(is_noisy=True)
    fit = TransformEstimation(
        algorithm="gauss-newton", residual="point-to-plane", sampling_deviation=7.0
    )
    normals = target.normals[pairs.target_rows]
    offsets = (_gaps(target, source, pairs, _POSE) * normals).sum(axis=1)
    both = _pair_covariances(target, source, pairs)
    variances = np.einsum("mi,mij,mj->m", normals, both, normals)
    expected = 0.5 * np.mean(pairs.weights * offsets**2 / variances)
    found = fit.objective(target, source, pairs, _START).linearise(_POSE).value
    assert found == pytest.approx(expected, rel=1e-10)


@_with_each_closed_form
def test_a_closed_form_is_at_the_minimum_in_one_step(step):
    target, source, pairs = _scene(noise=0.3)
    found, note = _fitted(TransformEstimation(algorithm=step), (target, source, pairs))
    rows = target.points[pairs.target_rows], source.points[pairs.source_rows]
    expected = fit_arun(*rows, pairs.weights)
    assert note == ""
    assert found.is_close(expected, translation=1e-12, rotation=1e-12)
    # Weights matter here, or the line above would say nothing of them.
    assert found.distance(fit_arun(*rows))[0] > 1e-3
    clean, _ = _fitted(TransformEstimation(algorithm=step), _scene(noise=0.0))
    assert clean.is_close(_POSE, translation=1e-12, rotation=1e-12)


def test_each_closed_form_is_the_one_it_is_called():
    target, source, pairs = _scene(noise=0.3)
    rows = target.points[pairs.target_rows], _START.apply(source.points[pairs.source_rows])
    objective = TransformEstimation().objective(target, source, pairs, _START)
    moments = PairMoments.of(*rows, objective.precisions[:, 0])
    # They differ by rounding alone, so only equality to the bit tells them apart.
    forms = {"svd": moments.by_singular_values(), "quaternion": moments.by_quaternion()}
    assert forms["svd"] != forms["quaternion"]
    for step, form in forms.items():
        assert (
            _fitted(TransformEstimation(algorithm=step), (target, source, pairs))[0]
            == form @ _START
        )


def test_steps_of_gauss_and_newton_end_where_the_closed_form_is():
    scene = _scene(noise=0.3)
    closed, _ = _fitted(TransformEstimation(algorithm="svd"), scene)
    first, note = _fitted(TransformEstimation(algorithm="gauss-newton"), scene)
    assert note == ""
    assert first.distance(closed)[0] > 1e-4
    settled, _ = _fitted(TransformEstimation(algorithm="gauss-newton"), scene, steps=20)
    assert settled.is_close(closed, translation=1e-10, rotation=1e-11)


@_with_each_step
def test_pairs_of_no_weight_pull_nothing(step):
    target, source, pairs = _scene()
    weights = np.where(np.arange(len(pairs)) % 4 == 0, 0.0, pairs.weights)
    kept = weights > 0.0
    # Without weight, the count that the objective is a mean over changes, but no minimum.
    some = _pairs((pairs.target_rows[kept], pairs.source_rows[kept]), weights[kept])
    all_pairs = _pairs((pairs.target_rows, pairs.source_rows), weights)
    found, expected = (
        _fitted(TransformEstimation(algorithm=step), (target, source, one))[0]
        for one in (all_pairs, some)
    )
    assert found.is_close(expected, translation=1e-10, rotation=1e-10)


def test_planes_find_a_known_motion():
    scene = _scene(noise=0.0, count=60)
    fit = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")
    found, note = _fitted(fit, scene, steps=8)
    assert note == ""
    assert found.is_close(_POSE, translation=1e-9, rotation=1e-10)


def _best_of(dof, scene, start):
    """The pose of least cost, by a search without derivatives over what is free."""
    target, source, pairs = scene

    def pose(free):
        x, y, z, yaw = free if dof == "xyz+yaw" else (*free[:2], 0.0, free[2])
        return Pose.from_step(np.array([x, y, z, 0.0, 0.0, yaw])) @ start

    def cost(free):
        squares = (_gaps(target, source, pairs, pose(free)) ** 2).sum(axis=1)
        return float(pairs.weights @ squares)

    first = np.zeros(4 if dof == "xyz+yaw" else 3)
    options = {"xatol": 1e-10, "fatol": 1e-14, "maxiter": 4000, "maxfev": 4000}
    return pose(minimize(cost, first, method="Nelder-Mead", options=options).x)


@_with_each_step
@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_locked_directions_stay_and_the_others_are_at_their_best(step, dof):
    scene, constraints = _scene(noise=0.2), Constraints(dof=dof)
    found, note = _fitted(
        TransformEstimation(algorithm=step),
        scene,
        constraints,
        steps=20 if step == "gauss-newton" else 1,
    )
    assert note == ""
    expected = _best_of(dof, scene, _START)
    assert found.is_close(expected, translation=1e-6, rotation=1e-7)
    assert found.distance(_START)[0] > 0.1
    tilt = found.rotation @ _START.rotation.T
    np.testing.assert_allclose(tilt[2], [0.0, 0.0, 1.0], atol=1e-12)
    assert (dof == "xy+yaw") == (abs(found.translation[2] - _START.translation[2]) < 1e-12)


_ON_A_LINE = "pairs on a line hold no rotation: a step of Gauss and Newton instead"


@_with_each_closed_form
def test_pairs_on_a_line_are_fitted_without_a_turn_about_it(step):
    # Through the origin at the start: elsewhere, to turn about a line is to move as well.
    start = Pose(_START.rotation, np.zeros(3))
    truth = start.retract(np.array([0.4, -0.3, 0.2, 0.05, -0.03, 0.08]))
    source = np.linspace(-10.0, 10.0, 25)[:, None] * [0.0, 0.6, 0.8]
    rows = np.arange(25), np.arange(25)
    scene = point_scan(truth.apply(source)), point_scan(source), _pairs(rows)
    found, note = _fitted(TransformEstimation(algorithm=step), scene, start=start)
    assert note == _ON_A_LINE
    turn = log_rotation(found.rotation @ start.rotation.T)
    assert abs(turn @ start.rotation @ [0.0, 0.6, 0.8]) < 1e-9
    assert np.linalg.norm(turn) > 0.05
    settled, _ = _fitted(TransformEstimation(algorithm=step), scene, start=start, steps=8)
    np.testing.assert_allclose(_gaps(*scene, settled), 0.0, atol=1e-9)


@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_pairs_on_an_upright_line_hold_no_yaw(dof):
    # Upright in the target's frame where the pairs are made.
    upright = _START.inverse().apply(np.linspace(-2.0, 2.0, 25)[:, None] * [0.0, 0.0, 1.0])
    target = _START.apply(upright) + np.array([0.3, 0.1, 0.2])
    scene = point_scan(target), point_scan(upright), _pairs((np.arange(25), np.arange(25)))
    found, note = _fitted(TransformEstimation(), scene, Constraints(dof=dof))
    assert note == _ON_A_LINE
    assert found.distance(_START)[1] < 1e-9
    moved = found.translation - _START.translation
    np.testing.assert_allclose(moved, [0.3, 0.1, 0.2 if dof == "xyz+yaw" else 0.0], atol=1e-9)


@_with_each_closed_form
def test_a_prior_is_heeded_by_steps_of_gauss_and_newton(step):
    scene = _scene()
    constraints = Constraints(prior=PosePrior.from_deviations(_START, 0.01, 0.001))
    found, note = _fitted(TransformEstimation(algorithm=step), scene, constraints, steps=3)
    assert note == "no closed form heeds a prior: steps of Gauss and Newton instead"
    newton, silence = _fitted(
        TransformEstimation(algorithm="gauss-newton"), scene, constraints, steps=3
    )
    assert silence == ""
    assert found == newton
    free, _ = _fitted(TransformEstimation(algorithm=step), scene)
    assert free.distance(found)[0] > 0.1


def test_a_prior_weighs_against_the_deviation_of_a_pair():
    scene = _scene()
    constraints = Constraints(prior=PosePrior.from_deviations(_START, 0.1, 0.01))
    sure, unsure = (
        _fitted(
            TransformEstimation(algorithm="gauss-newton", sampling_deviation=one),
            scene,
            constraints,
            steps=10,
        )[0]
        for one in (1e-4, 1e3)
    )
    free, _ = _fitted(TransformEstimation(), scene)
    assert sure.is_close(free, translation=1e-3, rotation=1e-4)
    assert unsure.is_close(_START, translation=1e-3, rotation=1e-4)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"step": "horn"}, "step must be 'svd', 'quaternion' or 'gauss-newton', got 'horn'"),
        ({"residual": "plane"}, "residual must be 'point-to-point' or .*, got 'plane'"),
        ({"residual": "point-to-plane"}, "step must be 'gauss-newton' .* no closed form, got 'svd"),
        ({"residual": "point-to-plane", "step": "quaternion"}, "closed form, got 'quaternion'"),
        ({"deviation": 0.0}, "deviation must be positive, got 0.0 m"),
        ({"lever": math.inf}, "lever must be positive, got inf m"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        TransformEstimation(**settings)
