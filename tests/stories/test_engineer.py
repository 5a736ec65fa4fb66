"""The work of a perception engineer: results to test, objects of other libraries, many pairs."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import scanlock
from reference.real_pairs import real_pair
from reference.samples import street, yaw_pose
from scanlock.cli import main

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


@pytest.fixture(scope="module")
def drive(scan_data):
    return scan_data / "kitti_drive_0005" / "velodyne_points" / "data"


@pytest.mark.data
def test_a_pair_of_a_drive_is_registered_tested_and_tuned(scan_data, drive, tmp_path, capsys):
    _, _, truth = real_pair(scan_data, "street 0_10")
    target, source = (scanlock.read_scan(drive / f"{k:010d}.bin") for k in (0, 10))
    result = scanlock.register(source=source, target=target)
    assert result
    assert result.ok
    assert result.status == "ok"
    assert result.target_from_source.is_close(truth, translation=0.1, rotation=math.radians(0.3))
    # The pose and its accuracy are seen at once, in one line and in a few.
    x, y, z = result.target_from_source.translation
    assert f"Pose([{x:.5g}, {y:.4f}, {z:.4f}] m" in repr(result)
    assert f"accuracy={result.accuracy}" in repr(result)
    assert f"right with {100.0 * result.probability:.1f}%; {result.accuracy}" in str(result)
    assert all(len(line) <= 100 for line in str(result).splitlines())
    assert np.all(result.accuracy.translation < 0.02)
    assert result.covariance.matrix.shape == (6, 6)

    # Arrays of points in the frame of the target, and a picture.
    moved = result.target_from_source @ source.points
    written = scanlock.transform_scan(source, result.target_from_source)
    assert np.array_equal(written.points, moved)
    figure = scanlock.registration_figure(result, source=source, target=target)
    figure.savefig(tmp_path / "pair.png")
    assert (tmp_path / "pair.png").stat().st_size > 50_000

    # A familiar knob of a familiar method, in Python and in a file of settings.
    search = scanlock.NearestNeighbourSearch(max_correspondence_distances=(5.0, 1.0))
    gicp = replace(scanlock.METHODS["gicp"], search=search)
    assert gicp == scanlock.Gicp(search=search)
    tuned = scanlock.register(source=source, target=target, method=gicp)
    assert tuned.ok
    assert tuned.target_from_source.is_close(
        result.target_from_source, translation=0.05, rotation=math.radians(0.2)
    )
    assert main(["settings", "gicp"]) == 0
    text = capsys.readouterr().out
    assert "call it d_max" in " ".join(text.replace("#", "").split())
    old, new = "distances = [20.0, 5.0, 1.0]", "distances = [5.0, 1.0]"
    assert old in text
    (tmp_path / "mine.toml").write_text(text.replace(old, new))
    assert scanlock.read_settings(tmp_path / "mine.toml") == gicp

    with pytest.raises(scanlock.InvalidInput, match="did you mean 'gicp'"):
        scanlock.register(source=source, target=target, method="gcip")
    with pytest.raises(TypeError, match="positional"):
        scanlock.register(source, target)


@pytest.mark.data
@pytest.mark.parametrize("executor", ["threads", None])
def test_pairs_of_a_drive_become_rows_of_a_table(drive, executor):
    pandas = pytest.importorskip("pandas")
    pairs = [(drive / f"{k + 5:010d}.bin", drive / f"{k:010d}.bin") for k in (0, 5)]
    pairs.insert(1, (drive / "gone.bin", pairs[0][1]))
    rows = scanlock.register_many(pairs, executor=executor, covariance=True)
    table = pandas.DataFrame(rows.to_dicts())
    assert table.ok.tolist() == [True, False, True]
    assert table.status.tolist() == ["ok", "error", "ok"]
    [failed] = table[~table.ok].to_dict("records")
    assert failed["error"] == "FileNotFoundError"
    assert failed["reason"] == f"{drive / 'gone.bin'}: no such file or directory"
    good = table[table.ok]
    assert (good.translation - np.linalg.norm(good[["x", "y", "z"]], axis=1)).abs().max() < 1e-9
    assert (good[["sigma_x", "sigma_y", "sigma_z"]] < 0.05).all(axis=None)
    assert good.target.tolist() == [str(target) for source, target in pairs if source.exists()]


@pytest.mark.data
def test_a_live_loop_gets_a_pose_for_every_scan(drive):
    def sensor():
        for k in range(5):
            scan = scanlock.read_scan(drive / f"{k:010d}.bin")
            if k == 3:
                yield np.random.default_rng(0).normal(0.0, 20.0, (5000, 3))
            yield scan

    steps = list(scanlock.odometry(sensor(), covariance=True))
    assert [step.ok for step in steps] == [True, True, True, False, False, True]
    path = np.array([step.pose.translation for step in steps[:3]])
    moved = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert np.all((moved > 0.2) & (moved < 0.5))
    assert steps[1].registration.accuracy is not None


def test_a_table_with_named_columns_is_a_scan(arrays, expected):
    pandas = pytest.importorskip("pandas")
    tables = {
        name: pandas.DataFrame({"ring": 0} | dict(zip("xyz", points.T, strict=True)))
        for name, points in arrays.items()
    }
    assert scanlock.register(**tables).target_from_source == expected.target_from_source


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
