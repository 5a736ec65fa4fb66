import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.pipelines.mapping import mapped_scans

_POSES = [yaw_pose(0.1 * k, (1.5 * k, 0.2 * k, 0.0)) for k in range(4)]


def _scans():
    for k, pose in enumerate(_POSES):
        yield pose.inverse().apply(street(k + 1))


@pytest.mark.parametrize("guess", ["identity", "velocity"])
def test_the_motions_chain_to_the_trajectory(guess):
    steps = list(mapped_scans(_scans(), guess=guess, method="sgc-ndt-d2d"))
    assert steps[0].registration is None
    assert steps[0].pose == Pose.identity()
    for step, truth in zip(steps, _POSES, strict=True):
        assert step.ok
        expected = _POSES[0].inverse() @ truth
        assert step.pose.is_close(expected, translation=0.2, rotation=math.radians(1.0))
    starts = [step.registration.history[0].pose for step in steps[1:]]
    assert starts[0] == Pose.identity()
    moved = starts[1].distance(Pose.identity())[0]
    assert moved > 1.0 if guess == "velocity" else moved == 0.0


def test_scans_come_one_at_a_time_and_go_out_as_soon_as_they_are_known():
    taken = []

    def feed():
        for k, scan in enumerate(_scans()):
            taken.append(k)
            yield scan

    steps = mapped_scans(feed())
    next(steps)
    assert taken == [0]
    next(steps)
    assert taken == [0, 1]


def test_a_pair_that_fails_is_flagged_and_the_next_begins_afresh():
    scans = [street(1), street(2, layout=77), street(3, layout=77)]
    steps = list(mapped_scans(scans, guess="velocity", method="sgc-ndt-d2d"))
    assert [step.ok for step in steps] == [True, False, True]
    assert steps[2].registration.history[0].pose == Pose.identity()
    assert np.isfinite(steps[2].pose.matrix).all()


def test_what_cannot_be_mapped_is_refused_by_name():
    with pytest.raises(InvalidInput, match="guess must be 'identity' or 'velocity', got 'imu'"):
        next(mapped_scans(_scans(), guess="imu"))
    with pytest.raises(InvalidInput, match="scan 1 holds no finite point"):
        list(mapped_scans([street(1), np.full((5, 3), np.nan)]))


def test_locked_directions_stay_as_they_begin():
    steps = list(mapped_scans(_scans(), dof="xy+yaw"))
    for step in steps:
        np.testing.assert_allclose(step.pose.matrix[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)
    assert steps[-1].pose.distance(Pose.identity())[0] > 4.0
