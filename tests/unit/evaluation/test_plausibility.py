import numpy as np
import pytest

from reference.wavy_drives import drifting, wavy_drive
from scanlock.evaluation.plausibility import find_warnings
from scanlock.geometry.pose import Pose

TRUTH = wavy_drive()[1]
WORLD = Pose.from_step(np.array([30.0, 5.0, 0.0, 0.0, 0.0, 1.0]))


def test_a_drift_in_another_world_is_no_reason_to_warn():
    assert find_warnings(drifting(TRUTH), TRUTH) == []
    assert find_warnings([WORLD @ pose for pose in TRUTH], TRUTH) == []
    assert find_warnings(TRUTH[:1], TRUTH[:1]) == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda pose: Pose(pose.rotation, 3.28 * pose.translation), "path is 352.9 m long"),
        (lambda pose: Pose(pose.rotation, 20.0 * np.cos(0.2 * pose.translation)), "the extent"),
        (lambda pose: Pose(np.eye(3), pose.translation), "the estimate has no rotations"),
    ],
)
def test_signs_of_another_motion_are_named(change, message):
    found = find_warnings([change(pose) for pose in TRUTH], TRUTH)
    assert any(message in text for text in found), found
