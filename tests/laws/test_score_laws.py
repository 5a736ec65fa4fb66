"""Scores against brute force and central differences; symmetry under exchange of the scans."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import differences
from reference import gaussian_scores as reference
from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import (
    GaussiansToGaussians,
    PointsToGaussians,
    ScoreShape,
)

pytestmark = pytest.mark.slow


class _Pair:
    """A few Gaussians in each scan whose pairs all score at a pose.

    Deviations range from `smallest` to `largest`; `away` [m] is the distance from both origins.
    """

    def __init__(self, seed, angle, away, smallest, largest, sharpness):
        rng = np.random.default_rng(seed)
        axis = rng.normal(size=3)
        rotation = exp_rotation(angle * axis / np.linalg.norm(axis))
        self.pose = Pose(rotation, away * rng.uniform(-1.0, 1.0, 3))
        deviations = np.exp(rng.uniform(np.log(smallest), np.log(largest), (7, 3)))
        deviations[::2, 0] = smallest  # as after regularisation: several at the minimum
        covariances = rotated_covariances(rng, deviations**2)
        counts = rng.integers(6, 200, 7)
        means = away * rng.uniform(-1.0, 1.0, 3) + largest * rng.normal(size=(3, 3))
        self.source = Gaussians.from_covariances(means, covariances[:3], counts[:3])
        # Each target lies where a draw from a source Gaussian may fall.
        draws = np.linalg.cholesky(covariances[np.arange(4) % 3]) @ rng.normal(size=(4, 3, 1))
        self.target = Gaussians.from_covariances(
            self.pose.apply(means[np.arange(4) % 3] + draws[:, :, 0]), covariances[3:], counts[3:]
        )
        self.points = read_only(
            self.pose.inverse().apply(self.target.means[np.arange(12) % 4])
            + 2.0 * smallest * rng.normal(size=(12, 3))
        )
        # The window starts at the same score, e^-8, for every sharpness.
        self.shape = ScoreShape(
            sharpness=sharpness, window_start=16.0 / sharpness, window_end=25.0 / sharpness
        )
        self.plain = {
            "sharpness": sharpness,
            "start": 16.0 / sharpness,
            "end": 25.0 / sharpness,
        }
        # A rotation moves points far from the origin, and the ends of long Gaussians.
        rotation_scale = float(np.abs(self.target.means).max()) + 3.0 * largest
        self.steps = (
            smallest
            / np.sqrt(sharpness)
            / np.array([1.0, 1.0, 1.0, rotation_scale, rotation_scale, rotation_scale])
        )

    @property
    def d2d(self):
        return GaussiansToGaussians(target=self.target, source=self.source, shape=self.shape)

    @property
    def p2d(self):
        return PointsToGaussians(target=self.target, points=self.points, shape=self.shape)

    def d2d_value(self, pose):
        return reference.d2d_value(pose, self.target, self.source, **self.plain)

    def p2d_value(self, pose):
        return reference.p2d_value(pose, self.target, self.points, **self.plain)


# Angles near zero and near half a turn; near the origin and as far from it as clouds are not
# recentred; round Gaussians, and regularised ones a hundred times as long as wide.
_pairs = st.builds(
    _Pair,
    seed=st.integers(0, 2**32 - 1),
    angle=st.one_of(st.just(0.0), st.floats(0, 1e-4), st.floats(0, 3.1), st.floats(3.14, np.pi)),
    away=st.sampled_from([0.0, 30.0, 5000.0]),
    smallest=st.just(0.1),
    largest=st.sampled_from([0.1, 1.0, 10.0]),
    sharpness=st.sampled_from([1.0, 0.05, 2.0]),
)

_ROUNDING = 1e-8
"""Relative error of a score 5 km from the origin: 1e-12 m of rounding over 0.1 m, times |s|."""


def _assert_derivatives(objective, value, pair):
    at = objective.linearise(pair.pose)
    np.testing.assert_allclose(at.value, value(pair.pose), rtol=_ROUNDING)

    # In units of the minimum deviation all derivatives of a score are of the order of one. The
    # stencil of step h errs by h^4, by h^2 times the jump of the third derivative (0.02, where
    # the window starts), and by the rounding over h.
    h = 1e-2
    gradient = differences.gradient(value, pair.pose, h * pair.steps)
    np.testing.assert_allclose(
        at.gradient * pair.steps, gradient * pair.steps, rtol=0, atol=1e-6 + _ROUNDING / h
    )

    # A difference of gradients errs by h times that jump and by the rounding over h.
    h = 1e-3
    hessian = differences.hessian(
        lambda pose: objective.linearise(pose).gradient, pair.pose, h * pair.steps
    )
    both = np.outer(pair.steps, pair.steps)
    np.testing.assert_allclose(
        at.hessian * both, hessian * both, rtol=0, atol=3e-5 + 3.0 * _ROUNDING / h
    )


@given(_pairs)
def test_d2d_and_its_derivatives_follow_from_the_definition(pair):
    _assert_derivatives(pair.d2d, pair.d2d_value, pair)


@given(_pairs)
def test_p2d_and_its_derivatives_follow_from_the_definition(pair):
    _assert_derivatives(pair.p2d, pair.p2d_value, pair)


@given(_pairs)
def test_d2d_is_symmetric_under_exchange_of_the_scans(pair):
    forth = pair.d2d.linearise(pair.pose).value
    exchanged = GaussiansToGaussians(target=pair.source, source=pair.target, shape=pair.shape)
    back = exchanged.linearise(pair.pose.inverse()).value
    np.testing.assert_allclose(forth, back, rtol=_ROUNDING)


@given(_pairs, st.integers(0, 2**32 - 1))
def test_scores_ignore_a_motion_common_to_both_scans(pair, seed):
    rng = np.random.default_rng(seed)
    common = Pose.from_step(np.concatenate([rng.uniform(-9.0, 9.0, 3), rng.normal(size=3)]))
    moved = common @ pair.pose
    target = pair.target.transformed(common)
    d2d = GaussiansToGaussians(target=target, source=pair.source, shape=pair.shape)
    p2d = PointsToGaussians(target=target, points=pair.points, shape=pair.shape)
    # Turning a covariance of condition 1e4 rounds it by 1e4 units in its last place.
    for score_of_moved, score in ((d2d, pair.d2d), (p2d, pair.p2d)):
        np.testing.assert_allclose(
            score_of_moved.linearise(moved).value, score.linearise(pair.pose).value, rtol=1e-7
        )


@given(_pairs)
def test_a_step_along_the_negative_gradient_lowers_the_score(pair):
    for objective in (pair.d2d, pair.p2d):
        at = objective.linearise(pair.pose)
        slope = at.gradient * pair.steps
        norm = np.linalg.norm(slope)
        if norm < 1e-3:
            continue
        # Within a hundredth of a deviation the second derivative cannot undo such a slope.
        step = -1e-2 * min(1.0, norm) * slope / norm * pair.steps
        assert objective.linearise(pair.pose.retract(step)).value < at.value
