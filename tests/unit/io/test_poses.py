import json

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io import (
    read_kitti_poses,
    read_pose,
    read_pose_matrix,
    read_tum_poses,
    write_kitti_poses,
    write_pose,
    write_tum_poses,
)

_POSE = Pose.from_step(np.array([512_345.123456789, -2.5, 1e-9, 0.4, -0.2, 0.1]))
_POSES = [_POSE, Pose.identity(), Pose.from_step(np.array([1.0, 2.0, 3.0, 0.0, 3.1, 0.0]))]
_MATRIX = _POSE.matrix


def _text(array):
    return "\n".join(" ".join(f"{value:.17g}" for value in row) for row in np.atleast_2d(array))


def _close(a, b):
    return a.is_close(b, translation=1e-9, rotation=1e-12)


def test_poses_round_trip_to_the_last_digit(tmp_path):
    write_pose(tmp_path / "a.txt", _POSE)
    lines = (tmp_path / "a.txt").read_text().splitlines()
    assert np.array_equal([[float(word) for word in line.split()] for line in lines], _MATRIX)
    again = read_pose(tmp_path / "a.txt")
    assert np.array_equal(again.translation, _POSE.translation)
    assert np.abs(again.rotation - _POSE.rotation).max() < 1e-15


@pytest.mark.parametrize(
    "text",
    [
        _text(_MATRIX),
        _text(_MATRIX[:3]),
        _text(_MATRIX.ravel()),
        _text(_MATRIX[:3].ravel()),
        _text(_MATRIX.reshape(-1, 1)),
        _text(_MATRIX).replace(" ", ", "),
        "# target from source\n\n" + _text(_MATRIX) + "  # done\n",
        str(_MATRIX.tolist()),
        json.dumps(_MATRIX[:3].tolist()),
        json.dumps({"method": "gicp", "target_from_source": _MATRIX.tolist()}),
        np.array2string(_MATRIX, floatmode="unique", max_line_width=200),
    ],
)
@pytest.mark.parametrize("name", ["a.txt", "a.pose"])
def test_a_pose_is_read_from_every_layout_of_text(save, text, name):
    assert _close(read_pose(save(name, text)), _POSE)


@pytest.mark.parametrize("shape", [(4, 4), (16,)])
def test_a_pose_is_read_from_json_and_numpy(tmp_path, shape):
    (tmp_path / "a.json").write_text(json.dumps(_MATRIX.reshape(shape).tolist()))
    np.save(tmp_path / "a.npy", _MATRIX.reshape(shape))
    assert _close(read_pose(tmp_path / "a.json"), _POSE)
    assert _close(read_pose(tmp_path / "a.npy"), _POSE)


@pytest.mark.parametrize("rows", [3, 4])
def test_a_matrix_is_read_unchanged_and_a_pose_corrected(save, rows):
    printed = _MATRIX.round(3)
    path = save("a.txt", _text(printed[:rows]))
    np.testing.assert_array_equal(read_pose_matrix(path), printed)
    assert read_pose(path) == Pose.from_matrix(printed)
    assert np.abs(read_pose(path).matrix - printed).max() > 1e-6


@pytest.mark.parametrize(
    ("name", "text", "complaint"),
    [
        ("a.txt", "1 0 0 0\n0 1 0\n0 0 1 0", "line 2: expected 4 numbers as on line 1, found 3"),
        ("a.txt", "1 0 0 0\n0 one 0 0\n0 0 1 0", "line 2: expected a number, found 'one'"),
        ("a.txt", "1 0 0\n0 1 0\n0 0 1", "numbers of shape \\(3, 3\\)"),
        ("a.txt", _text(np.ones((5, 12))), "numbers of shape \\(5, 12\\)"),
        ("a.txt", "# nothing", "numbers of shape"),
        ("a.txt", _text(2 * np.eye(4)[:3]), "must be a rotation"),
        ("a.txt", _text(np.diag([1, 1, -1, 1])), "must be a rotation"),
        ("a.txt", _text(_MATRIX.T), "looks transposed"),
        ("a.txt", "1 0 0 nan\n0 1 0 0\n0 0 1 0", "finite"),
        ("a.json", '{\n"target_from_source": [1,\n}', "line 3: expected JSON"),
        (
            "a.json",
            '{"source_from_target": []}',
            "key target_from_source, found source_from_target",
        ),
        ("a.json", '{"target_from_source": [[1, 2], [3]]}', "found other content"),
        ("a.json", '{"target_from_source": "I"}', "found other content"),
        ("a.json", "{}", "found no keys"),
        ("a.json", b"\xff\xfe{", "matrix in UTF-8"),
        ("a.json", "[" + "9" * 5000 + "]", "JSON: expected a matrix"),
        ("a.json", "[" * 100_000, "JSON: expected a matrix"),
        ("a.txt", "", "empty file"),
        ("a.npy", b"\x93NUMPY\1\0", "NumPy"),
    ],
)
def test_errors_name_the_invalid_content_of_a_pose(save, name, text, complaint):
    for read in (read_pose, read_pose_matrix):
        with pytest.raises(FormatError, match=complaint):
            read(save(name, text))


def test_missing_files_are_refused(tmp_path):
    for read in (read_pose, read_pose_matrix, read_kitti_poses, read_tum_poses):
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
