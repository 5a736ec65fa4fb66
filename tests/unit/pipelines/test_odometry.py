import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.pipelines.odometry import odometry

_POSES = [yaw_pose(0.1 * k, (1.5 * k, 0.2 * k, 0.0)) for k in range(4)]


def _scans():
    for k, pose in enumerate(_POSES):
        yield pose.inverse().apply(street(k + 1))


@pytest.mark.parametrize("guess", ["identity", "velocity"])
def test_poses_are_the_product_of_the_registered_motions(guess):
    steps = list(odometry(_scans(), guess=guess, method="sgc-ndt-d2d"))
    assert steps[0].registration is None
    assert steps[0].pose == Pose.identity()
    for step, truth in zip(steps, _POSES, strict=True):
        assert step.ok
        expected = _POSES[0].inverse() @ truth
        assert step.pose.is_close(expected, translation=0.2, rotation=math.radians(1.0))
    starts = [step.registration.history[0].pose for step in steps[1:]]
    assert starts[0] == Pose.identity()
    shift = starts[1].distance(Pose.identity())[0]
    assert shift > 1.0 if guess == "velocity" else shift == 0.0


def test_each_step_is_yielded_before_the_next_scan_is_read():
    read = []

    def feed():
        for k, scan in enumerate(_scans()):
            read.append(k)
            yield scan

    steps = odometry(feed())
    next(steps)
    assert read == [0]
    next(steps)
    assert read == [0, 1]


def test_the_registration_after_a_failed_one_starts_from_the_identity():
    scans = [street(1), street(2, layout=77), street(3, layout=77)]
    steps = list(odometry(scans, method="sgc-ndt-d2d"))
    assert [step.ok for step in steps] == [True, False, True]
    assert steps[2].registration.history[0].pose == Pose.identity()
    assert np.isfinite(steps[2].pose.matrix).all()


def test_two_threads_give_the_same_poses_and_read_one_scan_ahead():
    read = []

    def feed():
        for k, scan in enumerate(_scans()):
            read.append(k)
            yield scan

    alone = list(odometry(_scans()))
    steps = odometry(feed(), threads=2)
    poses = [next(steps).pose]
    assert len(read) <= 3
    poses += [step.pose for step in steps]
    assert poses == [step.pose for step in alone]


def test_an_invalid_scan_that_was_read_ahead_ends_the_trajectory_before_it():
    steps = odometry([street(1), street(2), np.full((5, 3), np.nan)], threads=2)
    assert next(steps).ok
    assert next(steps).ok
    with pytest.raises(InvalidInput, match="scan 2 has no finite point"):
        next(steps)


@pytest.mark.parametrize("guess", ["identity", "velocity"])
def test_a_trajectory_is_continued_with_its_last_pose_and_motion(guess):
    whole = list(odometry(_scans(), guess=guess))
    last = whole[2]
    motion = last.registration.target_from_source if guess == "velocity" else None
    rest = odometry(list(_scans())[2:], guess=guess, initial_pose=last.pose, initial_motion=motion)
    assert [step.pose for step in rest] == [step.pose for step in whole[2:]]


def test_scans_in_map_coordinates_start_at_their_places():
    far = np.array([500_000.0, 5_400_000.0, 120.0])
    steps = list(
        odometry(
            [pose.apply(scan) + far for pose, scan in zip(_POSES, _scans(), strict=True)],
            method="sgc-ndt-d2d",
        )
    )
    for step in steps[1:]:
        assert step.ok
        assert step.registration.history[0].pose == step.registration.origins.local(Pose.identity())
        shift = step.pose.apply(step.cloud.centroid) - step.cloud.centroid
        assert np.abs(shift).max() < 0.1


def test_every_motion_has_its_covariance_and_time():
    first, *steps = odometry(_scans(), covariance="sandwich", method="sgc-ndt-d2d")
    assert first.seconds > 0.0
    for step in steps:
        assert 1e-4 < step.registration.covariance.deviations[0] < 0.1
        assert step.seconds > step.registration.timings["total"]


def test_unknown_guesses_and_invalid_scans_are_refused():
    with pytest.raises(InvalidInput, match="guess must be 'identity' or 'velocity', got 'imu'"):
        next(odometry(_scans(), guess="imu"))
    with pytest.raises(InvalidInput, match="scan 1 has no finite point"):
        list(odometry([street(1), np.full((5, 3), np.nan)]))


def test_locked_degrees_of_freedom_keep_their_initial_values():
    steps = list(odometry(_scans(), dof="xy+yaw"))
    for step in steps:
        np.testing.assert_allclose(step.pose.matrix[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)
    assert steps[-1].pose.distance(Pose.identity())[0] > 4.0
