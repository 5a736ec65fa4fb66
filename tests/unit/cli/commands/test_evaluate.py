import json

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, in_other_frame
from scanlock.geometry.pose import Pose
from scanlock.io import write_kitti_poses, write_tum_poses

_TRUTH = [yaw_pose(0.0, (1.0 * k, 0.0, 0.0)) for k in range(150)]
_ESTIMATE = [yaw_pose(0.001 * k, (1.01 * k, 0.0, 0.0)) for k in range(150)]

_BEND = [Pose.identity()]
for _k in range(149):
    _BEND.append(_BEND[-1] @ yaw_pose(0.02, (1.0, 0.0, 0.02 * np.sin(_k))))


@pytest.fixture
def tracks(tmp_path):
    write_kitti_poses(tmp_path / "truth.txt", _TRUTH)
    write_kitti_poses(tmp_path / "drift.txt", _ESTIMATE)
    write_tum_poses(tmp_path / "truth_tum.txt", 0.1 * np.arange(150), _TRUTH)
    write_tum_poses(tmp_path / "drift_tum.txt", 0.1 * np.arange(150)[::2] + 0.01, _ESTIMATE[::2])
    return tmp_path


def test_absolute_relative_and_kitti_errors_are_reported(scanlock, tracks):
    done = scanlock("evaluate", tracks / "drift.txt", tracks / "truth.txt", "--json")
    found = json.loads(done.out)
    assert found["poses"] == 150
    np.testing.assert_allclose(found["absolute"]["translation_m"]["largest"], 1.49)
    turns = found["relative"]["rotation_deg"]
    np.testing.assert_allclose(turns["median"], np.degrees(0.001), rtol=1e-6)
    np.testing.assert_allclose(found["kitti"]["rotation_deg_per_100_m"], 5.787, atol=0.01)
    table = scanlock("evaluate", tracks / "drift.txt", tracks / "truth.txt").out
    assert table.startswith("0.862 m and 4.937 deg off (rmse) over 149.0 m, first poses aligned")
    assert "absolute (APE) [m]" in table
    assert "relative over 1 scan (RPE) [deg]" in table
    assert "deg/100 m over" in table
    assert found["kitti"]["by_length"][0]["length_m"] == 100.0
    assert found["warnings"] == []


def test_trajectories_with_times_are_matched_by_time(scanlock, tracks):
    done = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "truth_tum.txt", "--json")
    found = json.loads(done.out)
    assert (found["poses"], found["estimate_poses"], found["truth_poses"]) == (75, 75, 150)
    np.testing.assert_allclose(found["absolute"]["translation_m"]["largest"], 1.48)


def test_each_pose_is_matched_once_with_the_nearest_in_time_in_any_order(scanlock, tracks):
    times = np.array([0.52, 0.5, 0.31, 0.0, 7.0, 99.0])
    rows = [0, 5, 3, 0, 70, 1]
    write_tum_poses(tracks / "some.txt", times, [_TRUTH[row] for row in rows])
    done = scanlock("evaluate", tracks / "some.txt", tracks / "truth_tum.txt", "--json")
    found = json.loads(done.out)
    # Of 0.52 s and 0.5 s only the nearer matches the true pose at 0.5 s, and 99 s matches none.
    assert (found["poses"], found["estimate_poses"]) == (4, 6)
    assert found["absolute"]["translation_m"]["largest"] < 1e-12
    text = scanlock("evaluate", tracks / "some.txt", tracks / "truth_tum.txt").out
    assert "over 70.0 m" in text.splitlines()[0]
    assert "4 poses by time, of 6 estimated and 150 true" in text


def test_a_folder_of_scans_with_poses_is_accepted_as_truth(scanlock, tracks):
    scans = tracks / "sim" / "scans"
    scans.mkdir(parents=True)
    for k in range(150):
        (scans / f"{k:03d}.bin").touch()
    done = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "sim", "--json")
    assert done.code == 1
    assert "expected a folder of scans with their poses" in done.err
    (tracks / "sim" / "poses_tum.txt").write_bytes((tracks / "truth_tum.txt").read_bytes())
    by_folder = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "sim", "--json")
    by_file = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "truth_tum.txt", "--json")
    assert (by_folder.code, by_folder.out) == (0, by_file.out)


@pytest.mark.slow
def test_a_picture_of_both_trajectories_is_drawn(scanlock, tracks):
    both = tracks / "drift.txt", tracks / "truth.txt"
    path = tracks / "both.png"
    done = scanlock("evaluate", *both, "--picture", path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert done.out.endswith(f"wrote {path}\n")
    assert scanlock("evaluate", *both, "--picture", tracks / "both.gif").code == 1


def test_unmatched_trajectories_are_an_error_of_one_line(scanlock, tracks):
    done = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "truth.txt")
    assert done.code == 1
    assert "has 75 poses and" in done.err
    assert "--first 75" in done.err
    assert done.err.count("\n") == 1
    write_tum_poses(tracks / "later.txt", [1e9], _TRUTH[:1])
    done = scanlock("evaluate", tracks / "later.txt", tracks / "truth_tum.txt")
    assert "use the same clock" in done.err


def test_a_short_path_has_no_kitti_errors(scanlock, tmp_path):
    write_kitti_poses(tmp_path / "short.txt", _TRUTH[:5])
    done = scanlock("evaluate", tmp_path / "short.txt", tmp_path / "short.txt", "--align", "all")
    assert done.code == 0
    assert "need a path of more than 100 m" in done.out


def _evaluated(scanlock, *arguments):
    done = scanlock("evaluate", *arguments, "--json")
    assert done.code == 0, done.err
    return json.loads(done.out)


def test_relative_errors_by_distance_and_by_time(scanlock, tracks):
    both = tracks / "drift_tum.txt", tracks / "truth_tum.txt"
    by_distance = _evaluated(scanlock, *both, "--delta", 20, "--unit", "m")["relative"]
    by_time = _evaluated(scanlock, *both, "--delta", 2, "--unit", "s")["relative"]
    # The truth moves at 10 m/s, and every other pose of it is matched.
    assert (by_distance["pairs"], by_distance["rotation_deg"]["mean"]) == pytest.approx(
        (7, np.degrees(0.02)), rel=1e-6
    )
    assert by_time["translation_m"] == by_distance["translation_m"]
    every = _evaluated(scanlock, *both, "--delta", 20, "--unit", "m", "--all-pairs")
    # Rows 0 to 64 have a pose 20 m ahead, and row 65 one within 10 % of that.
    assert every["relative"]["pairs"] == 66
    table = scanlock("evaluate", *both, "--delta", 20, "--unit", "m").out
    assert "relative over 20 m (RPE) [m]" in table


def test_a_scale_is_aligned_and_printed(scanlock, tracks):
    scaled = [Pose(one.rotation, 0.5 * one.translation) for one in _BEND]
    write_kitti_poses(tracks / "half.txt", scaled)
    write_kitti_poses(tracks / "bend.txt", _BEND)
    both = tracks / "half.txt", tracks / "bend.txt"
    found = _evaluated(scanlock, *both, "--align", "all+scale")
    assert found["absolute"]["scale"] == pytest.approx(2.0)
    assert found["absolute"]["translation_m"]["largest"] < 1e-9
    assert any("74.5 m long, the true one 149.0 m" in text for text in found["warnings"])
    done = scanlock("evaluate", *both, "--align", "all+scale")
    assert "scale    2.000000" in done.out
    assert "warning  the estimated path" in done.out


def test_scans_are_matched_by_the_table_beside_the_trajectory(scanlock, tracks):
    write_kitti_poses(tracks / "truth.txt", _BEND)
    out = tracks / "out"
    out.mkdir()
    rows = list(range(0, 90, 10))
    write_kitti_poses(out / "trajectory_kitti.txt", [_BEND[row] for row in rows])
    table = "".join(f"{row},{row:06d},{float(row)}\n" for row in rows)
    (out / "scans.csv").write_text("number,name,time\n" + table)
    found = _evaluated(scanlock, out / "trajectory_kitti.txt", tracks / "truth.txt")
    assert (found["matched_by"], found["poses"], found["truth_poses"]) == ("scan number", 9, 150)
    assert found["absolute"]["translation_m"]["largest"] < 1e-9
    # A truth of the same scans only has a row for each of them.
    write_kitti_poses(tracks / "nine.txt", [_BEND[row] for row in rows])
    found = _evaluated(scanlock, out / "trajectory_kitti.txt", tracks / "nine.txt")
    assert (found["matched_by"], found["poses"]) == ("row", 9)
    # One of 60 rows does not reach scan 80.
    write_kitti_poses(tracks / "sixty.txt", _BEND[:60])
    done = scanlock("evaluate", out / "trajectory_kitti.txt", tracks / "sixty.txt")
    assert done.code == 1
    assert "has 9 poses and" in done.err


def test_scans_of_two_folders_are_matched_by_name(scanlock, tracks):
    for name, rows in {"out": [3, 7, 9, 20], "other": [7, 9, 11, 20, 25]}.items():
        (tracks / name).mkdir()
        write_kitti_poses(tracks / name / "t.txt", [_BEND[row] for row in rows])
        # Numbers count the scans of each folder, so only the names agree.
        table = "".join(f"{k},scan{row},{float(k)}\n" for k, row in enumerate(rows))
        (tracks / name / "scans.csv").write_text("number,name,time\n" + table)
    found = _evaluated(scanlock, tracks / "out" / "t.txt", tracks / "other" / "t.txt")
    assert (found["matched_by"], found["poses"]) == ("scan name", 3)
    assert found["absolute"]["translation_m"]["largest"] < 1e-9


def test_the_first_rows_are_compared_on_request(scanlock, tracks):
    write_kitti_poses(tracks / "some.txt", _ESTIMATE[:40])
    found = _evaluated(scanlock, tracks / "some.txt", tracks / "truth.txt", "--first", 30)
    assert (found["matched_by"], found["poses"]) == ("row", 30)
    assert scanlock("evaluate", tracks / "some.txt", tracks / "truth.txt", "--first", 1).code == 1


@pytest.fixture
def camera(tracks):
    """The bend in the frame of KITTI's camera, and its calib.txt, beside the bend itself."""
    calibration = Pose.from_step(np.array([0.01, -0.05, -0.29, 1.2, -1.2, 1.2]))
    write_kitti_poses(tracks / "camera.txt", in_other_frame(_BEND, calibration))
    write_kitti_poses(tracks / "laser.txt", _BEND)
    numbers = " ".join(f"{value:.17g}" for value in calibration.matrix[:3].ravel())
    (tracks / "calib.txt").write_text(f"Tr: {numbers}\n")
    return tracks


def test_the_camera_frame_of_kitti_is_converted_and_said(scanlock, camera):
    both = camera / "laser.txt", camera / "camera.txt"
    nominal = _evaluated(scanlock, *both)
    assert nominal["frame"] == "camera to laser (nominal axes)"
    assert nominal["absolute"]["translation_m"]["largest"] < 2.0
    exact = _evaluated(scanlock, *both, "--calib", camera / "calib.txt")
    assert exact["frame"] == "camera to laser (calib.txt)"
    assert exact["absolute"]["translation_m"]["largest"] < 1e-9
    wrong = _evaluated(scanlock, *both, "--axes", "same")
    assert wrong["frame"] == "same"
    assert wrong["absolute"]["translation_m"]["largest"] > 50.0
    assert "another sensor frame" in wrong["notes"][0]
    text = " ".join(scanlock("evaluate", *both).out.split())
    assert "the true poses are in KITTI's camera frame, converted to the laser's" in text
    assert "exact with --calib calib.txt, or with the sequence folder" in text


def test_an_estimate_in_the_camera_frame_is_converted_too(scanlock, camera):
    swapped = camera / "camera.txt", camera / "laser.txt"
    found = _evaluated(scanlock, *swapped, "--calib", camera / "calib.txt")
    assert found["absolute"]["translation_m"]["largest"] < 1e-9
    assert "the estimated poses" in found["notes"][0]
    assert _evaluated(scanlock, camera / "camera.txt", camera / "camera.txt")["frame"] == "same"


def test_frames_that_no_camera_explains_are_refused(scanlock, tracks):
    mounted = yaw_pose(2.0, (0.0, 0.0, 0.0))
    write_kitti_poses(tracks / "bend.txt", _BEND)
    write_kitti_poses(tracks / "mounted.txt", in_other_frame(_BEND, mounted))
    done = scanlock("evaluate", tracks / "bend.txt", tracks / "mounted.txt")
    assert done.code == 1
    assert "in another sensor frame, rotated by 115 deg" in done.err
    assert "--axes same" in done.err
    # A straight drive does not show the axes across it.
    straight = in_other_frame(_TRUTH, CAMERA_FROM_LASER)
    write_kitti_poses(tracks / "straight.txt", straight)
    done = scanlock("evaluate", tracks / "truth.txt", tracks / "straight.txt")
    assert "turns too little to tell" in done.err
    found = _evaluated(scanlock, tracks / "truth.txt", tracks / "straight.txt", "--axes", "camera")
    assert found["absolute"]["translation_m"]["largest"] < 1e-9


@pytest.mark.data
def test_some_scans_of_a_real_drive_are_compared_with_its_whole_truth(
    scanlock, scan_data, tmp_path
):
    drive = scan_data / "kitti_drive_0005"
    mapped = scanlock("map", drive, "-o", tmp_path / "out", "--every", 5, "--scans", 4)
    assert mapped.code == 0
    for name in ("trajectory_kitti.txt", "trajectory_tum.txt"):
        found = _evaluated(scanlock, tmp_path / "out" / name, drive / "consensus_chain.txt")
        assert (found["matched_by"], found["poses"]) == ("scan number", 4)
        assert found["relative"]["translation_m"]["largest"] < 0.03
    done = scanlock("evaluate", tmp_path / "out" / "trajectory_tum.txt", drive)
    assert "the GPS/IMU track (oxts) of a raw drive is off by decimetres" in done.err
    # 26 September 2011, 13:04:32.3, as the clock of the drive shows it.
    first = (tmp_path / "out" / "trajectory_tum.txt").read_text().split()[0]
    assert float(first) == pytest.approx(1317042272.335, abs=1e-3)
