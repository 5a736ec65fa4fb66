"""Scans in another frame, and merged scans."""

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.scan_file import ScanFile
from scanlock.io.transform import keep_rows, merge_scans, transform_scan

_RNG = np.random.default_rng(3)
_POSE = Pose.from_step(np.array([4.0, -2.0, 0.5, 0.1, -0.2, 1.1]))


def _scan(count=6, **fields):
    return ScanFile(points=_RNG.normal(size=(count, 3)), fields=fields, format="ply")


def test_points_normals_and_viewpoint_move_and_other_fields_stay():
    normals = _RNG.normal(size=(6, 3)).astype(np.float32)
    scan = _scan(
        nx=normals[:, 0], ny=normals[:, 1], nz=normals[:, 2], normals=normals, ring=np.arange(6)
    )
    moved = transform_scan(scan, _POSE)
    np.testing.assert_allclose(moved.points, scan.points @ _POSE.rotation.T + _POSE.translation)
    turned = normals @ _POSE.rotation.T
    np.testing.assert_allclose(moved.fields["normals"], turned, rtol=1e-6)
    for name, column in zip(("nx", "ny", "nz"), turned.T, strict=True):
        np.testing.assert_allclose(moved.fields[name], column, rtol=1e-6)
        assert moved.fields[name].dtype == np.float32
    np.testing.assert_array_equal(moved.fields["ring"], scan.fields["ring"])
    assert moved.viewpoint is None


def test_the_inverse_pose_returns_the_scan():
    scan = ScanFile(
        points=_RNG.normal(size=(6, 3)), fields={}, format="pcd", viewpoint=Pose.identity()
    )
    again = transform_scan(transform_scan(scan, _POSE), _POSE.inverse())
    np.testing.assert_allclose(again.points, scan.points, atol=1e-12)
    assert again.viewpoint.is_close(Pose.identity(), translation=1e-12, rotation=1e-7)


def test_rows_without_a_return_become_nan_and_keep_their_place():
    points = _RNG.normal(size=(6, 3))
    points[2] = 0.0
    moved = transform_scan(ScanFile(points=points, fields={}, format="bin"), _POSE)
    assert np.isnan(moved.points).all(axis=1).tolist() == [False, False, True, False, False, False]


def test_a_merged_scan_has_the_rows_of_all_scans_and_their_numbers():
    first = _scan(4, intensity=np.arange(4.0), ring=np.arange(4, dtype=np.uint8))
    second = _scan(3, ring=np.arange(3, dtype=np.uint16), time=np.arange(3.0))
    merged = merge_scans([first, second])
    np.testing.assert_array_equal(merged.points, np.vstack([first.points, second.points]))
    assert merged.fields["scan"].tolist() == [0, 0, 0, 0, 1, 1, 1]
    assert merged.fields["ring"].tolist() == [0, 1, 2, 3, 0, 1, 2]
    assert merged.fields["ring"].dtype == np.uint16
    assert np.isnan(merged.fields["intensity"][4:]).all()
    assert np.isnan(merged.fields["time"][:4]).all()
    colours = np.stack([merged.fields[name] for name in ("red", "green", "blue")], axis=1)
    assert len(np.unique(colours[:4], axis=0)) == len(np.unique(colours[4:], axis=0)) == 1
    assert (colours[0] != colours[-1]).any()


def test_colours_of_a_scan_are_kept():
    first = _scan(2, red=np.array([1, 2]), green=np.array([3, 4]), blue=np.array([5, 6]))
    merged = merge_scans([first, _scan(2)])
    assert merged.fields["red"].tolist() == [1, 2, 0, 0]


def test_a_field_named_scan_is_kept():
    merged = merge_scans([_scan(2, scan=np.array([7, 8])), _scan(1)])
    assert merged.fields["scan"].tolist() == [7, 8, 0]
    assert merged.fields["scan_2"].tolist() == [0, 0, 1]


def test_rows_without_a_return_are_left_out_of_a_merged_scan():
    points = _RNG.normal(size=(5, 3))
    points[1], points[3] = 0.0, np.nan
    merged = merge_scans([ScanFile(points=points, fields={"row": np.arange(5)}, format="bin")])
    assert merged.fields["row"].tolist() == [0, 2, 4]


def test_fields_of_different_widths_are_refused():
    with pytest.raises(InvalidInput, match="field normal must have one width in all scans"):
        merge_scans([_scan(2, normal=np.zeros((2, 3))), _scan(2, normal=np.zeros(2))])


def test_no_scan_and_no_row_are_refused():
    with pytest.raises(InvalidInput, match="at least one scan"):
        merge_scans([])
    with pytest.raises(InvalidInput, match="at least one row"):
        keep_rows(_scan(2), np.zeros(2, bool))


def test_kept_rows_of_an_organised_scan_are_unorganised():
    scan = ScanFile(points=_RNG.normal(size=(6, 3)), fields={}, format="pcd", width=3, height=2)
    assert keep_rows(scan, np.ones(6, bool)).height == 2
    kept = keep_rows(scan, np.arange(6) < 4)
    assert (kept.width, kept.height) == (4, 1)


def test_stations_are_moved_before_they_are_merged():
    poses = [Pose(np.eye(3), [float(k), 0.0, 0.0]) for k in range(2)]
    stations = [
        ScanFile(points=np.ones((2, 3)), fields={}, format="e57", file_from_station=pose)
        for pose in poses
    ]
    with pytest.raises(InvalidInput, match="stations with different poses in their file"):
        merge_scans(stations)
    moved = [transform_scan(scan, scan.file_from_station) for scan in stations]
    assert [scan.file_from_station for scan in moved] == [None, None]
    merged = merge_scans(moved)
    assert merged.points[:, 0].tolist() == [1, 1, 2, 2]
    assert merged.file_from_station is None
