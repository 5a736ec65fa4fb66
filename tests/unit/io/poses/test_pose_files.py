import json

import numpy as np
import pytest

from scanlock.errors import FormatError
from scanlock.geometry.pose import Pose
from scanlock.io import read_pose, read_pose_matrix, write_pose

_POSE = Pose.from_step(np.array([512_345.123456789, -2.5, 1e-9, 0.4, -0.2, 0.1]))
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
    for read in (read_pose, read_pose_matrix):
        with pytest.raises(FileNotFoundError, match="no such"):
            read(tmp_path / "no.txt")
