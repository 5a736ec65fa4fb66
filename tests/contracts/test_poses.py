"""Poses that every method must find."""

import math

import numpy as np
import pytest

from contracts.traits import METRES, RADIANS, TRAITS, gap, motion, result, source, target
from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

pytestmark = pytest.mark.parametrize("method", METHODS)


def test_every_method_has_its_traits(method):
    assert set(TRAITS) == set(METHODS)


def test_identical_scans_give_identity(method):
    same = register(source=target(), target=target(), method=method)
    assert same.status is Status.OK
    assert gap(same.target_from_source, Pose.identity(), target()) < TRAITS[method].identity_gap
    assert same.overlap == 1.0
    if TRAITS[method].identity_gap < 1e-6:
        np.testing.assert_allclose(same.score, 1.0, rtol=1e-6)


@pytest.mark.parametrize("index", range(4))
def test_a_known_motion_is_recovered(method, index):
    motions = TRAITS[method].motions
    truth = motions[index % len(motions)]
    found = register(source=truth.inverse().apply(street(2)), target=target(), method=method)
    assert found.status is Status.OK
    assert found.target_from_source.is_close(truth, translation=METRES, rotation=RADIANS)


def test_a_motion_with_roll_and_pitch_is_recovered(method):
    scale = 1.0 if TRAITS[method].motions[0].translation[0] > 1.0 else 0.25
    truth = Pose.from_step(scale * np.array([1.0, -1.0, 0.3, 0.08, -0.05, 0.3]))
    found = register(source=truth.inverse().apply(street(2)), target=target(), method=method)
    assert found.status is Status.OK
    # Without ground, roll and pitch hang on the heights of parts alone.
    assert found.target_from_source.is_close(truth, translation=0.2, rotation=3 * RADIANS)


@pytest.mark.parametrize(
    ("angle", "translation"), [(0.7, (3.0, 2.0, 0.0)), (2.0, (1.0, 1.0, 0.5)), (0, (0.3, 0.2, 0))]
)
def test_moving_both_scans_moves_the_pose_with_them(method, angle, translation):
    # Polar bins and voxels stay with the axes while the scans move, so parts are cut elsewhere:
    # either pose is as right as the other, and they differ by no more than two right ones.
    common = yaw_pose(angle, translation)
    moved = register(
        source=common.apply(source(method)), target=common.apply(target()), method=method
    )
    expected = common @ result(method).target_from_source @ common.inverse()
    assert moved.status is Status.OK
    assert moved.target_from_source.is_close(expected, translation=2 * METRES, rotation=2 * RADIANS)
    away = gap(moved.target_from_source @ common, expected @ common, source(method))
    assert away < TRAITS[method].common_gap


def test_half_a_turn_of_both_scans_turns_the_pose_exactly(method):
    # Half a turn maps bins onto bins and voxels onto voxels, so only rounding is left, and the
    # solver's stopping step of a micrometre.
    common = yaw_pose(np.pi, (0.0, 0.0, 0.0))
    moved = register(
        source=common.apply(source(method)), target=common.apply(target()), method=method
    )
    expected = common @ result(method).target_from_source @ common.inverse()
    away = gap(moved.target_from_source, expected, source(method))
    assert away < TRAITS[method].half_turn_gap


def test_exchanging_the_scans_inverts_the_pose(method):
    back = register(source=target(), target=source(method), method=method)
    assert back.status is Status.OK
    there_and_back = back.target_from_source @ result(method).target_from_source
    symmetric = TRAITS[method].is_symmetric
    metres, radians = (1e-4, 1e-5) if symmetric else (2 * METRES, 2 * RADIANS)
    assert there_and_back.is_close(Pose.identity(), translation=metres, rotation=radians)


def test_the_order_of_points_does_not_matter(method):
    rng = np.random.default_rng(3)
    shuffled = register(
        source=rng.permutation(source(method)), target=rng.permutation(target()), method=method
    )
    # Sums in another order round otherwise, and the solver stops within a micrometre.
    assert shuffled.status is Status.OK
    away = gap(shuffled.target_from_source, result(method).target_from_source, source(method))
    assert away < TRAITS[method].order_gap


@pytest.mark.parametrize("far", [[300.0, 0.0, 0.0], [0.0, 0.0, 1e4], [1e6, 1e6, 0.0], [1e12] * 3])
def test_a_point_far_away_changes_nothing(method, far):
    is_local = TRAITS[method].is_local
    reference = np.vstack([far, target()]) if is_local else target()
    found = register(source=np.vstack([source(method), far]), target=reference, method=method)
    assert found.status is Status.OK
    # One more point divides a mean by one more, so the last step may differ; where all pairs
    # set the gate, a far one moves it.
    away = gap(found.target_from_source, result(method).target_from_source, source(method))
    assert away < (1e-5 if is_local else 2 * METRES)


@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_locked_directions_stay_as_in_the_initial_pose(method, dof):
    initial = Pose.from_step(np.array([0.0, 0.0, 0.02, 0.005, -0.003, 0.0]))
    found = register(
        source=source(method), target=target(), method=method, initial=initial, dof=dof
    )
    pose = found.target_from_source
    turned = log_rotation(pose.rotation @ initial.rotation.T)
    np.testing.assert_allclose(turned[:2], 0.0, atol=1e-9)
    if dof == "xy+yaw":
        assert abs(pose.translation[2] - initial.translation[2]) < 1e-9
    # What is free still finds its place.
    x, y, _ = motion(method).translation
    assert math.hypot(pose.translation[0] - x, pose.translation[1] - y) < 2 * METRES


def test_a_prior_pulls_as_hard_as_it_is_sure(method):
    truth = motion(method)
    believed = Pose(truth.rotation, truth.translation + np.array([0.2, 0.1, 0.0]))
    gaps = []
    for deviation in (1e-5, 1e5):
        prior = PosePrior.from_deviations(believed, deviation, deviation)
        found = register(
            source=source(method), target=target(), method=method, initial=believed, prior=prior
        )
        gaps.append(found.target_from_source.distance(believed)[0])
    assert gaps[0] < 0.01
    assert gaps[1] > 0.1
