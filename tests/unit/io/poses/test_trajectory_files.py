import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io import (
    read_kitti_poses,
    read_numbered_poses,
    read_trajectory,
    read_tum_poses,
    write_kitti_poses,
    write_tum_poses,
)

_POSES = [
    Pose.from_step(np.array([512_345.123456789, -2.5, 1e-9, 0.4, -0.2, 0.1])),
    Pose.identity(),
    Pose.from_step(np.array([1.0, 2.0, 3.0, 0.0, 3.1, 0.0])),
]


def _close(a, b):
    return a.is_close(b, translation=1e-9, rotation=1e-12)


@pytest.mark.parametrize("read", [read_kitti_poses, read_numbered_poses, read_tum_poses])
def test_missing_files_are_refused(tmp_path, read):
    with pytest.raises(FileNotFoundError, match="no such"):
        read(tmp_path / "no.txt")


def test_kitti_round_trip(tmp_path):
    path = tmp_path / "a.txt"
    write_kitti_poses(path, _POSES)
    assert [len(line.split()) for line in path.read_text().splitlines()] == [12] * 3
    assert all(map(_close, read_kitti_poses(path), _POSES))


def test_tum_round_trip(tmp_path):
    path = tmp_path / "a.txt"
    times = [1647090478.400633, 1647090478.5006332, 1647090479.0]
    write_tum_poses(path, times, _POSES)
    stamps, poses = read_tum_poses(path)
    assert stamps.tolist() == times
    assert all(map(_close, poses, _POSES))


def test_tum_quaternions_have_the_scalar_last(save):
    half = np.sqrt(0.5)
    stamps, poses = read_tum_poses(save("a.txt", f"# t x y z q\n2.5 1 2 3 0 0 {half} {half}\n"))
    assert stamps.tolist() == [2.5]
    assert np.allclose(poses[0].apply(np.array([1.0, 0.0, 0.0])), [1, 3, 3])


@pytest.mark.parametrize(
    ("read", "text", "complaint"),
    [
        (
            read_kitti_poses,
            "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1\n",
            "line 2: expected 12",
        ),
        (read_kitti_poses, "0 1 0 0 0 0 1 0 0 0 0 1 0\n", "line 1: expected 12 numbers, found 13"),
        (read_kitti_poses, "# c\n\n1 0 0 0 0 1 0 0 0 0 2 0\n", "line 3: .* must be a rotation"),
        (read_kitti_poses, "# c\n", "lines of 12 numbers, found none"),
        (
            read_numbered_poses,
            "0.5" + 12 * " 1",
            "line 1: expected the number of a scan, found 0.5",
        ),
        (read_numbered_poses, "1e300" + 12 * " 1", "line 1: expected the number of a scan"),
        (read_numbered_poses, "-1" + 12 * " 1", "line 1: expected the number of a scan, found -1"),
        (read_tum_poses, "0 1 2 3 0 0 0 1\n# c\n1 1 2 3 0 0 0 2\n", "line 3: .*norm 1, got 2"),
        (read_tum_poses, "nan 1 2 3 0 0 0 1\n", "line 1: .*time must be finite"),
        (read_tum_poses, "0 1 2 inf 0 0 0 1\n", "line 1"),
        (read_tum_poses, "0 1 2 3 0 0 0\n", "line 1: expected 8 numbers, found 7"),
    ],
)
def test_errors_name_the_invalid_line_of_a_trajectory(save, read, text, complaint):
    with pytest.raises(FormatError, match=complaint):
        read(save("a.txt", text))


def test_invalid_trajectories_are_not_written(tmp_path):
    with pytest.raises(InvalidInput, match="at least one pose"):
        write_kitti_poses(tmp_path / "a.txt", [])
    with pytest.raises(InvalidInput, match="3 finite numbers"):
        write_tum_poses(tmp_path / "a.txt", [1, 2], _POSES)
    with pytest.raises(InvalidInput, match="3 finite numbers"):
        write_tum_poses(tmp_path / "a.txt", [1, 2, np.nan], _POSES)
    assert list(tmp_path.iterdir()) == []


def test_trajectories_are_read_in_both_formats(tmp_path):
    write_kitti_poses(tmp_path / "k.txt", _POSES)
    write_tum_poses(tmp_path / "t.txt", np.arange(3.0), _POSES)
    times, poses = read_trajectory(tmp_path / "k.txt")
    assert times is None
    assert all(map(_close, poses, _POSES))
    times, poses = read_trajectory(tmp_path / "t.txt")
    np.testing.assert_array_equal(times, np.arange(3.0))
    assert all(map(_close, poses, _POSES))
    (tmp_path / "x.txt").write_text("1 2 3\n")
    with pytest.raises(FormatError):
        read_trajectory(tmp_path / "x.txt")
