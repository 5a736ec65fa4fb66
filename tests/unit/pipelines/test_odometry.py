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
