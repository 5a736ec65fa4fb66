import numpy as np
import pytest

from reference.wavy_drives import drifting, wavy_drive
from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, compare_axes, in_other_frame
from scanlock.geometry.pose import Pose
from scanlock.io import read_kitti_poses

TRUTH = wavy_drive()[1]
ESTIMATE = drifting(TRUTH)
# Off the nominal axes by a degree, with the lever arm of KITTI.
CALIBRATION = CAMERA_FROM_LASER @ Pose.from_step(np.array([0.27, 0.0, -0.08, 0.01, -0.012, 0.005]))
STRAIGHT = [Pose(np.eye(3), np.array([1.0 * k, 0.0, 0.0])) for k in range(60)]


def _noisy(poses, seed):
    rng = np.random.default_rng(seed)
    slips = rng.normal(0.0, [0.02, 0.02, 0.02, 0.001, 0.001, 0.001], (len(poses), 6))
    return [pose @ Pose.from_step(slip) for pose, slip in zip(poses, slips, strict=True)]


def test_the_camera_frame_is_recognised_on_either_side():
    camera = in_other_frame(TRUTH, CALIBRATION)
    assert compare_axes(ESTIMATE, camera).relation == "truth_camera"
    assert compare_axes(camera, ESTIMATE).relation == "estimate_camera"
    assert compare_axes(camera, in_other_frame(ESTIMATE, CALIBRATION)).relation == "same"


@pytest.mark.parametrize("count", [2, 3, 16, 60, 120])
def test_trajectories_in_one_frame_stay_so(count):
    assert compare_axes(ESTIMATE[:count], TRUTH[:count]).relation == "same"
    assert compare_axes(_noisy(STRAIGHT, 1)[:count], STRAIGHT[:count]).relation == "same"


def test_bad_estimates_are_never_rotated():
    rng = np.random.default_rng(2)
    still = [Pose.identity()] * 120
    backwards = TRUTH[::-1]
    wild = [Pose.from_step(rng.normal(0.0, 1.0, 6)) for _ in TRUTH]
    for estimate in (still, wild):
        assert compare_axes(estimate, TRUTH).relation == "same"
    # A drive in reverse moves against its axes, and turns the other way.
    assert compare_axes(backwards, TRUTH).relation in ("same", "rotated")


def test_a_straight_drive_is_unclear():
    camera = in_other_frame(_noisy(STRAIGHT, 3), CAMERA_FROM_LASER)
    assert compare_axes(_noisy(STRAIGHT, 4), camera).relation == "unclear"


def test_another_rotation_is_measured():
    mounted = Pose.from_step(np.array([0.1, 0.0, 0.0, 0.0, 0.0, 2.5]))
    found = compare_axes(ESTIMATE, in_other_frame(TRUTH, mounted))
    assert found.relation == "rotated"
    np.testing.assert_allclose(np.degrees(found.angle), np.degrees(2.5), atol=1.0)


def test_the_conversion_is_exact_with_the_calibration():
    back = in_other_frame(in_other_frame(TRUTH, CALIBRATION), CALIBRATION.inverse())
    for pose, expected in zip(back, TRUTH, strict=True):
        assert pose.is_close(expected, translation=1e-9, rotation=1e-7)


# The short drives are fast.
_DRIVES = [
    pytest.param(f"{number:02d}", marks=[] if number in (3, 4) else pytest.mark.slow)
    for number in range(11)
]


@pytest.mark.data
@pytest.mark.parametrize("drive", _DRIVES)
def test_all_drives_of_kitti_are_recognised(scan_data, drive):
    camera = read_kitti_poses(scan_data / "trajectories" / "kitti_ground_truth" / f"{drive}.txt")
    exact = Pose.from_matrix(np.loadtxt(scan_data / "kitti_00" / "Tr_velo_to_cam0.txt"))
    laser = _noisy(in_other_frame(camera, exact.inverse()), 5)
    assert compare_axes(laser, camera).relation == "truth_camera"
    assert compare_axes(_noisy(camera, 6), camera).relation == "same"
    # The first seconds of some drives are straight; then the frame is unclear, never the same.
    assert compare_axes(laser[:50], camera[:50]).relation in ("truth_camera", "unclear")
