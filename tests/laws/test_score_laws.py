"""Scores against brute force and central differences; symmetry under exchange of the scans."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reference import differences
from reference import gaussian_scores as reference
from reference.samples import turned_covariances
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import (
    GaussiansToGaussians,
    PointsToGaussians,
    ScoreShape,
)


class _Scene:
    """A few Gaussians on either side that all reach each other at a pose.

    Deviations run from `least` to `most`; `away` [m] is how far they lie from both origins.
    """

    def __init__(self, seed, angle, away, least, most, sharpness):
        rng = np.random.default_rng(seed)
        axis = rng.normal(size=3)
        rotation = exp_rotation(angle * axis / np.linalg.norm(axis))
        self.pose = Pose(rotation, away * rng.uniform(-1.0, 1.0, 3))
        deviations = np.exp(rng.uniform(np.log(least), np.log(most), (7, 3)))
        deviations[::2, 0] = least  # as after a floor: several at the least there is
        covariances = turned_covariances(rng, deviations**2)
        counts = rng.integers(6, 200, 7)
        means = away * rng.uniform(-1.0, 1.0, 3) + most * rng.normal(size=(3, 3))
        self.source = Gaussians.from_covariances(means, covariances[:3], counts[:3])
        # Each target lies where a draw from a source Gaussian may fall.
        draws = np.linalg.cholesky(covariances[np.arange(4) % 3]) @ rng.normal(size=(4, 3, 1))
        self.target = Gaussians.from_covariances(
            self.pose.apply(means[np.arange(4) % 3] + draws[:, :, 0]), covariances[3:], counts[3:]
        )
        self.points = read_only(
            self.pose.inverse().apply(self.target.means[np.arange(12) % 4])
            + 2.0 * least * rng.normal(size=(12, 3))
        )
        # The window keeps its place in the score, so that what is cut stays under e^-8.
        self.shape = ScoreShape(
            sharpness=sharpness, window_start=16.0 / sharpness, window_end=25.0 / sharpness
        )
        self.plain = {
            "sharpness": sharpness,
            "start": 16.0 / sharpness,
            "end": 25.0 / sharpness,
        }
        # A turn moves what is far from the origin, and swings the ends of long Gaussians.
        rotation_scale = float(np.abs(self.target.means).max()) + 3.0 * most
        self.units = (
            least
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


# Near zero, near half a turn; near the origin and as far as clouds are left where they are;
# round Gaussians, and floored ones a hundred times as long as wide.
_scenes = st.builds(
    _Scene,
    seed=st.integers(0, 2**32 - 1),
    angle=st.one_of(st.just(0.0), st.floats(0, 1e-4), st.floats(0, 3.1), st.floats(3.14, np.pi)),
    away=st.sampled_from([0.0, 30.0, 5000.0]),
    least=st.just(0.1),
    most=st.sampled_from([0.1, 1.0, 10.0]),
    sharpness=st.sampled_from([1.0, 0.05, 2.0]),
)

_ROUNDING = 1e-8
"""Relative error of a score 5 km from the origin: 1e-12 m of rounding over 0.1 m, times |s|."""


def _assert_derivatives(objective, value, scene):
    at = objective.linearise(scene.pose)
    np.testing.assert_allclose(at.value, value(scene.pose), rtol=_ROUNDING)

    # In units of the least deviation all derivatives of a score are of the order of one. The
    # stencil of step h errs by h^4, by h^2 times the kink in the third derivative (0.02, where
    # the window begins), and by the rounding over h.
    h = 1e-2
    gradient = differences.gradient(value, scene.pose, h * scene.units)
    np.testing.assert_allclose(
        at.gradient * scene.units, gradient * scene.units, rtol=0, atol=1e-6 + _ROUNDING / h
    )

    # A difference of gradients errs by h times that kink and by the rounding over h.
    h = 1e-3
    hessian = differences.hessian(
        lambda pose: objective.linearise(pose).gradient, scene.pose, h * scene.units
    )
    both = np.outer(scene.units, scene.units)
    np.testing.assert_allclose(
        at.hessian * both, hessian * both, rtol=0, atol=3e-5 + 3.0 * _ROUNDING / h
    )


@given(_scenes)
def test_d2d_and_its_derivatives_follow_from_the_definition(scene):
    _assert_derivatives(scene.d2d, scene.d2d_value, scene)


@given(_scenes)
def test_p2d_and_its_derivatives_follow_from_the_definition(scene):
    _assert_derivatives(scene.p2d, scene.p2d_value, scene)


@given(_scenes)
def test_d2d_is_symmetric_under_exchange_of_the_scans(scene):
    forth = scene.d2d.linearise(scene.pose).value
    exchanged = GaussiansToGaussians(target=scene.source, source=scene.target, shape=scene.shape)
    back = exchanged.linearise(scene.pose.inverse()).value
    np.testing.assert_allclose(forth, back, rtol=_ROUNDING)


@given(_scenes, st.integers(0, 2**32 - 1))
def test_scores_ignore_a_motion_common_to_both_scans(scene, seed):
    rng = np.random.default_rng(seed)
    common = Pose.from_step(np.concatenate([rng.uniform(-9.0, 9.0, 3), rng.normal(size=3)]))
    moved = common @ scene.pose
    target = scene.target.transformed(common)
    d2d = GaussiansToGaussians(target=target, source=scene.source, shape=scene.shape)
    p2d = PointsToGaussians(target=target, points=scene.points, shape=scene.shape)
    # Turning a covariance of condition 1e4 rounds it by 1e4 units in its last place.
    for there, here in ((d2d, scene.d2d), (p2d, scene.p2d)):
        np.testing.assert_allclose(
            there.linearise(moved).value, here.linearise(scene.pose).value, rtol=1e-7
        )


@given(_scenes)
def test_a_descent_step_along_the_gradient_lowers_the_score(scene):
    for objective in (scene.d2d, scene.p2d):
        at = objective.linearise(scene.pose)
        slope = at.gradient * scene.units
        norm = np.linalg.norm(slope)
        if norm < 1e-3:
            continue
        # Within a hundredth of a deviation the second derivative cannot undo such a slope.
        step = -1e-2 * min(1.0, norm) * slope / norm * scene.units
        assert objective.linearise(scene.pose.retract(step)).value < at.value
