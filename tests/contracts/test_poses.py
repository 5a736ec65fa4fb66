"""Accuracy and invariances of the pose of every method."""

import math

import numpy as np
import pytest

from contracts.traits import (
    METRES,
    RADIANS,
    TRAITS,
    max_point_distance,
    motion,
    result,
    source,
    target,
)
from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

pytestmark = pytest.mark.parametrize("method", METHODS)


def test_every_method_has_traits(method):
    assert set(TRAITS) == set(METHODS)


def test_identical_scans_give_the_identity(method):
    same = register(source=target(), target=target(), method=method)
    assert same.status is Status.OK
    assert (
        max_point_distance(same.target_from_source, Pose.identity(), target())
        < TRAITS[method].identity_tolerance
    )
    assert same.overlap == 1.0
    if TRAITS[method].identity_tolerance < 1e-6:
        np.testing.assert_allclose(same.score, 1.0, rtol=1e-6)


@pytest.mark.parametrize("index", range(4))
def test_a_known_motion_is_recovered(method, index):
    motions = TRAITS[method].motions
    truth = motions[index % len(motions)]
    found = register(source=truth.inverse().apply(street(2)), target=target(), method=method)
    assert found.status is Status.OK
    assert found.target_from_source.is_close(truth, translation=METRES, rotation=RADIANS)


@pytest.mark.slow
def test_a_motion_with_roll_and_pitch_is_recovered(method):
    scale = 1.0 if TRAITS[method].motions[0].translation[0] > 1.0 else 0.25
    truth = Pose.from_step(scale * np.array([1.0, -1.0, 0.3, 0.08, -0.05, 0.3]))
    found = register(source=truth.inverse().apply(street(2)), target=target(), method=method)
    assert found.status is Status.OK
    # Without the ground, only the heights of clusters constrain roll and pitch.
    assert found.target_from_source.is_close(truth, translation=0.2, rotation=3 * RADIANS)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "translation"), [(0.7, (3.0, 2.0, 0.0)), (2.0, (1.0, 1.0, 0.5)), (0, (0.3, 0.2, 0))]
)
def test_the_pose_is_equivariant_to_a_common_motion(method, angle, translation):
    # Polar bins and voxels do not move with the scans, so the clusters differ. Both poses are
    # within the tolerance of the truth.
    common = yaw_pose(angle, translation)
    moved = register(
        source=common.apply(source(method)), target=common.apply(target()), method=method
    )
    expected = common @ result(method).target_from_source @ common.inverse()
    assert moved.status is Status.OK
    assert moved.target_from_source.is_close(expected, translation=2 * METRES, rotation=2 * RADIANS)
    distance = max_point_distance(
        moved.target_from_source @ common, expected @ common, source(method)
    )
    assert distance < TRAITS[method].common_motion_tolerance


@pytest.mark.slow
def test_the_pose_is_equivariant_to_half_a_turn_up_to_rounding(method):
    # Half a turn maps bins onto bins and voxels onto voxels, so only rounding and the step
    # tolerance of a micrometre remain.
    common = yaw_pose(np.pi, (0.0, 0.0, 0.0))
    moved = register(
        source=common.apply(source(method)), target=common.apply(target()), method=method
    )
    expected = common @ result(method).target_from_source @ common.inverse()
    distance = max_point_distance(moved.target_from_source, expected, source(method))
    assert distance < TRAITS[method].half_turn_tolerance


@pytest.mark.slow
def test_exchanging_the_scans_inverts_the_pose(method):
    back = register(source=target(), target=source(method), method=method)
    assert back.status is Status.OK
    round_trip = back.target_from_source @ result(method).target_from_source
    symmetric = TRAITS[method].is_symmetric
    metres, radians = (1e-4, 1e-5) if symmetric else (2 * METRES, 2 * RADIANS)
    assert round_trip.is_close(Pose.identity(), translation=metres, rotation=radians)


@pytest.mark.slow
def test_the_order_of_points_does_not_change_the_pose(method):
    rng = np.random.default_rng(3)
    shuffled = register(
        source=rng.permutation(source(method)), target=rng.permutation(target()), method=method
    )
    # Sums round differently in another order, and the step tolerance is a micrometre.
    assert shuffled.status is Status.OK
    distance = max_point_distance(
        shuffled.target_from_source, result(method).target_from_source, source(method)
    )
    assert distance < TRAITS[method].order_tolerance


@pytest.mark.slow
@pytest.mark.parametrize("far", [[300.0, 0.0, 0.0], [0.0, 0.0, 1e4], [1e6, 1e6, 0.0], [1e12] * 3])
def test_a_distant_point_does_not_change_the_pose(method, far):
    is_local = TRAITS[method].is_local
    target_points = np.vstack([far, target()]) if is_local else target()
    found = register(source=np.vstack([source(method), far]), target=target_points, method=method)
    assert found.status is Status.OK
    # Means over one more point may change the last step. A threshold from the statistics of all
    # correspondences changes with a distant one.
    distance = max_point_distance(
        found.target_from_source, result(method).target_from_source, source(method)
    )
    assert distance < (1e-5 if is_local else 2 * METRES)


@pytest.mark.slow
@pytest.mark.parametrize("dof", ["xyz+yaw", "xy+yaw"])
def test_locked_directions_keep_their_initial_values(method, dof):
    initial = Pose.from_step(np.array([0.0, 0.0, 0.02, 0.005, -0.003, 0.0]))
    found = register(
        source=source(method), target=target(), method=method, initial=initial, dof=dof
    )
    pose = found.target_from_source
    rotation = log_rotation(pose.rotation @ initial.rotation.T)
    np.testing.assert_allclose(rotation[:2], 0.0, atol=1e-9)
    if dof == "xy+yaw":
        assert abs(pose.translation[2] - initial.translation[2]) < 1e-9
    # The free directions are still estimated.
    x, y, _ = motion(method).translation
    assert math.hypot(pose.translation[0] - x, pose.translation[1] - y) < 2 * METRES


@pytest.mark.slow
def test_a_prior_acts_by_its_precision(method):
    truth = motion(method)
    mean = Pose(truth.rotation, truth.translation + np.array([0.2, 0.1, 0.0]))
    distances = []
    for deviation in (1e-5, 1e5):
        prior = PosePrior.from_deviations(mean, deviation, deviation)
        found = register(
            source=source(method), target=target(), method=method, initial=mean, prior=prior
        )
        distances.append(found.target_from_source.distance(mean)[0])
    assert distances[0] < 0.01
    assert distances[1] > 0.1
