import json

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.io import write_kitti_poses, write_tum_poses

_TRUTH = [yaw_pose(0.0, (1.0 * k, 0.0, 0.0)) for k in range(150)]
_ESTIMATE = [yaw_pose(0.001 * k, (1.01 * k, 0.0, 0.0)) for k in range(150)]


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
    assert "absolute [m]" in table
    assert "deg/100 m over" in table


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
    assert text.startswith("4 poses matched, of 6 estimated and 150 true, over 70.0 m")


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
    path = tracks / "new" / "both.png"
    done = scanlock("evaluate", *both, "--picture", path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert done.out.endswith(f"wrote {path}\n")
    assert scanlock("evaluate", *both, "--picture", tracks / "both.gif").code == 1


def test_unmatched_trajectories_are_an_error_of_one_line(scanlock, tracks):
    done = scanlock("evaluate", tracks / "drift_tum.txt", tracks / "truth.txt")
    assert done.code == 1
    assert "has 75 poses and" in done.err
    assert done.err.count("\n") == 1
    write_tum_poses(tracks / "later.txt", [1e9], _TRUTH[:1])
    done = scanlock("evaluate", tracks / "later.txt", tracks / "truth_tum.txt")
    assert "use the same clock" in done.err


def test_a_short_path_has_no_kitti_errors(scanlock, tmp_path):
    write_kitti_poses(tmp_path / "short.txt", _TRUTH[:5])
    done = scanlock("evaluate", tmp_path / "short.txt", tmp_path / "short.txt", "--align", "all")
    assert done.code == 0
    assert "need a path of more than 100 m" in done.out
