import pickle

import numpy as np
import pytest

from reference.differences import gradient
from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, inverse_left_jacobian, log_rotation
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.newton import Newton

_DEVIATIONS = np.array([0.5, 1.0, 0.2, 0.05, 0.02, 0.1])


def _prior(seed=0):
    rng = np.random.default_rng(seed)
    mixing = rng.normal(size=(6, 6))
    covariance = np.diag(_DEVIATIONS) @ (mixing @ mixing.T + np.eye(6)) @ np.diag(_DEVIATIONS)
    return PosePrior(Pose.from_step(rng.normal(size=6)), 0.5 * (covariance + covariance.T))


def _objective(seed=1):
    rng = np.random.default_rng(seed)
    target = gaussians(rng, 60)
    source = target.transformed(yaw_pose(-0.1, (0.3, 0, 0)))
    return GaussiansToGaussians(target=target, source=source)


@pytest.mark.parametrize("angle", [0.0, 1e-6, 1e-4, 0.3, 2.0, 3.1])
def test_the_inverse_left_jacobian_is_the_derivative_of_the_logarithm(angle):
    phi = angle * np.array([2.0, -1.0, 2.0]) / 3.0
    step = 1e-6
    slopes = [
        (log_rotation(exp_rotation(step * unit) @ exp_rotation(phi))
         - log_rotation(exp_rotation(-step * unit) @ exp_rotation(phi))) / (2.0 * step)
        for unit in np.eye(3)
    ]  # fmt: skip
    np.testing.assert_allclose(inverse_left_jacobian(phi), np.column_stack(slopes), atol=1e-8)


def test_a_prior_is_zero_at_its_mean_and_one_half_at_one_deviation():
    prior = PosePrior.from_deviations(yaw_pose(0.4, (5.0, 1.0, 0.0)), 0.5, 0.1)
    at_mean = prior.linearise(prior.pose)
    assert at_mean.value == 0.0
    np.testing.assert_array_equal(at_mean.gradient, 0.0)
    away = Pose(prior.pose.rotation, prior.pose.translation + np.array([0.5, 0.0, 0.0]))
    np.testing.assert_allclose(prior.linearise(away).value, 0.5)
    rotated = Pose(
        exp_rotation(np.array([0, 0.1, 0])) @ prior.pose.rotation, prior.pose.translation
    )
    np.testing.assert_allclose(prior.linearise(rotated).value, 0.5)


@pytest.mark.parametrize("seed", range(4))
def test_the_gradient_of_a_prior_matches_differences(seed):
    prior = _prior(seed)
    pose = Pose.from_step(np.random.default_rng(seed + 10).normal(size=6))
    quadratic = prior.linearise(pose)
    expected = gradient(lambda at: prior.linearise(at).value, pose, np.full(6, 1e-3))
    np.testing.assert_allclose(quadratic.gradient, expected, rtol=1e-7)
    assert np.linalg.eigvalsh(quadratic.hessian)[0] > 0.0


def test_without_constraints_the_objective_is_returned():
    objective = _objective()
    assert UNCONSTRAINED.applied_to(objective) is objective


@pytest.mark.parametrize(("dof", "locked"), [("xyz+yaw", [3, 4]), ("xy+yaw", [2, 3, 4])])
def test_locked_directions_keep_their_initial_values(dof, locked):
    start = Pose.from_step(np.array([0.2, -0.1, 0.05, 0.02, -0.03, -0.1]))
    constrained = Constraints(dof=dof).applied_to(_objective())
    at = constrained.linearise(start)
    np.testing.assert_array_equal(at.gradient[locked], 0.0)
    np.testing.assert_array_equal(at.hessian[locked], 0.0)
    solution = Newton().minimise(constrained, start)
    assert solution.reason.is_converged
    step = log_rotation(solution.pose.rotation @ start.rotation.T)
    np.testing.assert_allclose(step[:2], 0.0, atol=1e-12)
    assert abs(step[2]) > 0.01
    if dof == "xy+yaw":
        np.testing.assert_allclose(solution.pose.translation[2], start.translation[2], atol=1e-12)


def test_a_tight_prior_sets_the_pose_and_a_loose_one_does_not():
    objective, elsewhere = _objective(), yaw_pose(0.15, (0.5, 0.2, 0.1))
    found = Newton().minimise(objective, Pose.identity()).pose
    for deviation, expected in ((1e-6, elsewhere), (1e6, found)):
        prior = PosePrior.from_deviations(elsewhere, deviation, deviation)
        solution = Newton().minimise(
            Constraints(prior=prior).applied_to(objective), Pose.identity()
        )
        assert solution.pose.is_close(expected, translation=1e-4, rotation=1e-5)


def test_the_minimum_balances_prior_and_data():
    objective, prior = _objective(), _prior(3)
    solution = Newton().minimise(Constraints(prior=prior).applied_to(objective), Pose.identity())
    pull = objective.linearise(solution.pose).gradient
    back = prior.linearise(solution.pose).gradient / objective.count
    np.testing.assert_allclose(pull, -back, atol=1e-5)
    assert np.abs(pull).max() > 1e-3


@pytest.mark.parametrize(
    ("covariance", "message"),
    [
        (np.eye(3), r"finite \(6, 6\) matrix, got shape \(3, 3\)"),
        (np.full((6, 6), np.nan), "finite"),
        (np.diag([1.0, 1, 1, 1, 1, 0]), "smallest eigenvalue 0; dof locks"),
        (np.eye(6) + np.eye(6, k=1), "asymmetry 1"),
    ],
)
def test_an_invalid_covariance_is_rejected(covariance, message):
    with pytest.raises(InvalidInput, match=message):
        PosePrior(Pose.identity(), covariance)


def test_invalid_constraints_are_rejected():
    with pytest.raises(InvalidInput, match=r"dof must be one of xyz\+rpy.*, got 'yaw'"):
        Constraints(dof="yaw")
    with pytest.raises(InvalidInput, match=r"rotation must be positive, got 0\.0 rad"):
        PosePrior.from_deviations(Pose.identity(), 1.0, 0.0)


def test_priors_compare_by_value_and_survive_a_pickle():
    prior = _prior(5)
    again = pickle.loads(pickle.dumps(prior))
    assert again == prior
    assert hash(again) == hash(prior)
    assert prior != _prior(6)
    assert not prior.covariance.flags.writeable
