"""Scans as other libraries hold them: the pose is the same, and no library is imported for it."""

from types import SimpleNamespace

import numpy as np
import pytest

import scanlock
from reference.samples import street, yaw_pose

pytestmark = pytest.mark.slow

_MOTION = yaw_pose(0.1, (0.7, -0.4, 0.05))


@pytest.fixture(scope="module")
def arrays():
    return {"source": _MOTION.inverse().apply(street(2)), "target": street(1)}


@pytest.fixture(scope="module")
def expected(arrays):
    result = scanlock.register(**arrays)
    assert result
    return result


def _structured(points):
    array = np.zeros(len(points), [("intensity", "f4"), ("x", "f8"), ("y", "f8"), ("z", "f8")])
    for axis, name in enumerate("xyz"):
        array[name] = points[:, axis]
    return array


def _open3d(points):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(points))


def _open3d_tensor(points):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    return open3d.t.geometry.PointCloud(open3d.core.Tensor(points))


@pytest.mark.parametrize(
    "made",
    [
        _structured,
        _open3d,
        _open3d_tensor,
        lambda points: dict(zip("xyz", points.T, strict=True)),
        lambda points: SimpleNamespace(points=points),
        lambda points: scanlock.ScanFile(points=points, fields={}, format="ply"),
    ],
    ids=["structured", "open3d", "open3d-tensor", "columns", "points", "scan-file"],
)
def test_clouds_of_other_libraries_give_the_same_pose(arrays, expected, made):
    clouds = {name: made(points) for name, points in arrays.items()}
    assert scanlock.register(**clouds).target_from_source == expected.target_from_source


def test_a_cloud_of_laspy_gives_the_same_place(arrays, expected, tmp_path):
    laspy = pytest.importorskip("laspy")
    clouds = {}
    for name, points in arrays.items():
        header = laspy.LasHeader(version="1.4", point_format=6)
        header.scales = [1e-4] * 3
        las = laspy.LasData(header)
        las.x, las.y, las.z = points.T
        las.write(tmp_path / f"{name}.las")
        clouds[name] = laspy.read(tmp_path / f"{name}.las")
    result = scanlock.register(**clouds)
    assert result
    assert result.target_from_source.is_close(
        expected.target_from_source, translation=2e-3, rotation=1e-3
    )


def test_files_written_by_open3d_are_registered_and_merged(arrays, expected, tmp_path):
    open3d = pytest.importorskip("open3d", exc_type=ImportError)
    scans = {}
    for (name, points), ending in zip(arrays.items(), (".pcd", ".ply"), strict=True):
        path = tmp_path / f"{name}{ending}"
        assert open3d.io.write_point_cloud(str(path), _open3d(points))
        scans[name] = scanlock.read_scan(path)
    result = scanlock.register(**scans)
    assert result.target_from_source.is_close(
        expected.target_from_source, translation=2e-3, rotation=1e-3
    )
    moved = scanlock.transform_scan(scans["source"], result.target_from_source)
    merged = scanlock.merge_scans([scans["target"], moved])
    scanlock.write_scan(tmp_path / "both.ply", merged)
    again = open3d.io.read_point_cloud(str(tmp_path / "both.ply"))
    assert len(again.points) == len(merged)
    assert again.has_colors()


def test_a_result_is_tested_in_one_line_and_seen_in_one_print(expected):
    assert expected.ok
    assert expected.status == "ok"
    text = str(expected)
    assert "at one sigma" in text
    assert f"{expected.target_from_source.translation[0]:.5f}" in text
    assert str(expected.accuracy) in repr(expected)
