import pickle

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.scan_file import ScanFile


def _scan(**changes):
    contents = {
        "points": np.arange(12.0).reshape(4, 3),
        "fields": {"ring": np.arange(4), "normal": np.ones((4, 3))},
        "format": "ply",
        "viewpoint": Pose.identity(),
        "notes": ("guessed",),
    }
    return ScanFile(**(contents | changes))


def test_arrays_are_read_only_and_those_of_the_caller_are_not():
    points, ring = np.zeros((4, 3)), np.arange(4)
    scan = _scan(points=points, fields={"ring": ring})
    points[0] = 1.0
    ring[0] = 9
    with pytest.raises(ValueError, match="read-only"):
        scan.points[0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        scan.fields["ring"][0] = 2
    with pytest.raises(TypeError):
        scan.fields["more"] = ring


def test_length_width_and_height():
    scan = _scan()
    assert (len(scan), scan.width, scan.height) == (4, 4, 1)
    organised = _scan(width=2, height=2)
    assert (len(organised), organised.width, organised.height) == (4, 2, 2)


def test_scans_can_be_pickled():
    scan = _scan(width=2, height=2)
    again = pickle.loads(pickle.dumps(scan))
    assert np.array_equal(again.points, scan.points)
    assert again.fields.keys() == scan.fields.keys()
    assert np.array_equal(again.fields["normal"], scan.fields["normal"])
    assert (again.format, again.width, again.height) == ("ply", 2, 2)
    assert (again.viewpoint, again.notes) == (scan.viewpoint, scan.notes)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"points": np.zeros((4, 2))}, "points must be"),
        ({"points": np.zeros((4, 3), np.float32)}, "float32"),
        ({"points": np.zeros((0, 3)), "fields": {}}, "at least one row"),
        ({"width": 3}, "3 x 1 for 4"),
        ({"fields": {"ring": np.arange(3)}}, "'ring' of shape"),
        ({"fields": {"ring": np.zeros((4, 2, 2))}}, "'ring' of shape"),
        ({"fields": {"x": np.arange(4)}}, "must not be named x"),
    ],
)
def test_inconsistent_contents_are_refused(changes, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        _scan(**changes)
