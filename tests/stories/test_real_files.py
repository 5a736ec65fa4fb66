import struct
from dataclasses import replace

import numpy as np
import pytest

from reference.scan_formats import read_float32, read_pcd, read_ply, read_table
from scanlock.errors import FormatError
from scanlock.geometry.pose import Pose
from scanlock.io import (
    describe_scan,
    read_kitti_poses,
    read_labels,
    read_pose,
    read_scan,
    read_scans,
    read_tum_poses,
    write_e57_poses,
    write_scan,
)

pytestmark = [pytest.mark.slow, pytest.mark.data]


def _files(folder, pattern, count):
    found = sorted(folder.glob(pattern))
    assert len(found) == count
    return found


def _stacked(columns):
    return np.stack([columns[axis] for axis in "xyz"], axis=1)


def test_pcd_files_of_eleven_sensors(scan_data):
    for path in _files(scan_data, "formats/pcd/*.pcd", 11):
        scan, slow = read_scan(path), read_pcd(path)
        assert np.array_equal(scan.points, _stacked(slow), equal_nan=True)
        assert {"x", "y", "z", *scan.fields} == set(slow)
        for name, values in scan.fields.items():
            assert values.dtype == slow[name].dtype
            assert np.array_equal(values, slow[name])
        assert scan.viewpoint is not None


def test_ply_files_of_cloudcompare(scan_data):
    for path in _files(scan_data, "hdl32_pair/*.ply", 2):
        scan, slow = read_scan(path), read_ply(path)
        assert np.array_equal(scan.points, _stacked(slow))
        assert np.array_equal(scan.fields["scalar_intensity"], slow["scalar_intensity"])


@pytest.mark.parametrize(
    ("pattern", "count", "width", "names"),
    [
        ("kitti_drive_0005/**/*.bin", 60, 4, ["intensity"]),
        ("kitti_00/velodyne/*.bin", 18, 4, ["intensity"]),
        ("rellis_offroad/*.bin", 2, 4, ["intensity"]),
        ("av2_pair/*.bin", 2, 4, ["intensity"]),
        ("forest_os1/*_xyzl.bin", 4, 4, ["intensity"]),
        ("newer_college/newer_01/*.bin", 10, 3, []),
        ("newer_college/newer_06/*e*w*d_*.bin", 3, 3, []),
        ("newer_college/newer_06/raw_*.bin", 3, 3, []),
        ("handheld_balm/scans/*.bin", 40, 3, []),
    ],
)
def test_the_row_length_of_raw_floats_is_guessed(scan_data, pattern, count, width, names):
    paths = _files(scan_data, pattern, count)
    for path in paths:
        scan = read_scan(path)
        rows = np.fromfile(path, dtype="<f4").reshape(-1, width)
        assert np.array_equal(scan.points, rows[:, :3])
        assert list(scan.fields) == names
    assert np.array_equal(read_scan(paths[0]).points, read_float32(paths[0], width)[:, :3])


@pytest.mark.parametrize(
    ("name", "width"), [("kitti_00/velodyne/000094.bin", 4), ("handheld_balm/scans/000000.bin", 3)]
)
def test_raw_floats_truncated_to_rows_of_another_length_are_refused(
    scan_data, tmp_path, name, width
):
    data = (scan_data / name).read_bytes()
    other = 7 - width
    for rows in (1001, 15_001):
        size = 4 * other * rows
        assert size % (4 * width)
        (tmp_path / "a.bin").write_bytes(data[:size])
        with pytest.raises(FormatError, match=f"rows of {width} float32, as the values suggest"):
            read_scan(tmp_path / "a.bin")


def test_a_column_of_labels_can_be_named(scan_data):
    for path in _files(scan_data, "forest_os1/*_xyzl.bin", 4):
        labels = read_scan(path, columns="x y z label").fields["label"]
        assert set(np.unique(labels)) == {0.0, 1.0}
        assert "labels rather than" in describe_scan(path).notes[-1]
    path = scan_data / "rellis_offroad" / "000104"
    scan = read_scan(path.with_suffix(".bin"))
    labels = read_labels(path.with_suffix(".label"), count=len(scan))
    assert np.array_equal(labels, np.fromfile(path.with_suffix(".label"), dtype="<u4"))


def test_columns_of_times_are_refused_as_scans(scan_data):
    for path in _files(scan_data, "newer_college/newer_06/times_*.bin", 3):
        with pytest.raises(FormatError, match="only ascend"):
            read_scan(path)


def test_text_tables_with_and_without_names(scan_data):
    named = read_scan(scan_data / "car_cloud_pair" / "car_cloud400.csv")
    slow = read_table(scan_data / "car_cloud_pair" / "car_cloud400.csv", ",", 1)
    assert np.array_equal(named.points, slow[:, :3])
    assert list(named.fields) == ["nx", "ny", "nz"]
    assert np.array_equal(np.stack(list(named.fields.values()), axis=1), slow[:, 3:])
    bare = read_scan(scan_data / "car_cloud_pair" / "car_cloud401.csv")
    slow = read_table(scan_data / "car_cloud_pair" / "car_cloud401.csv", "", 0)
    assert np.array_equal(bare.points, slow)
    for path in _files(scan_data, "terrestrial_3dtk/*.3d", 3):
        assert np.array_equal(read_scan(path).points, read_table(path, "", 0))


def test_las_agrees_with_its_specification(scan_data):
    pytest.importorskip("laspy")
    plain, packed = (scan_data / "formats" / "las" / f"autzen_trim.{end}" for end in ("las", "laz"))
    data = plain.read_bytes()
    start, size = struct.unpack_from("<I", data, 96)[0], struct.unpack_from("<H", data, 105)[0]
    rows = [struct.unpack_from("<iiiH", data, at) for at in range(start, len(data), size)]
    scale, offset = np.array(struct.unpack_from("<6d", data, 131)).reshape(2, 3)
    rows = np.array(rows)
    for path in (plain, packed):
        scan = read_scan(path)
        # The header gives feet.
        assert np.abs(scan.points - 0.3048 * (rows[:, :3] * scale + offset)).max() < 1e-9
        assert scan.crs.unit_text == "foot (0.3048 m)"
        assert np.array_equal(scan.fields["intensity"], rows[:, 3])


def test_las_points_span_the_bounding_box_of_the_header(scan_data):
    pytest.importorskip("laspy")
    for path in _files(scan_data, "formats/las/*", 5):
        box = np.array(struct.unpack_from("<6d", path.read_bytes(), 179)).reshape(3, 2)
        scan = read_scan(path)
        points = scan.points / scan.metres_per_unit
        assert np.abs(points.max(axis=0) - box[:, 0]).max() < 0.011
        assert np.abs(points.min(axis=0) - box[:, 1]).max() < 0.011


@pytest.mark.parametrize(
    "name",
    [
        "formats/las/MixedConifer.laz",
        "formats/las/Topography.laz",
        "formats/las/autzen_trim.las",
        "formats/las/pine_plot.laz",
        "formats/copc/lone-star.copc.laz",
        "two_epochs_autzen/autzen-bmx-2010.las",
        "aerial_ahn/ahn_2386_9702.laz",
    ],
)
def test_las_files_written_unchanged_are_equal(scan_data, tmp_path, name):
    pytest.importorskip("laspy")
    scan = read_scan(scan_data / name)
    path = tmp_path / f"again{name[-4:]}"
    write_scan(path, scan)
    after = read_scan(path)
    assert np.array_equal(after.points, scan.points)
    assert after.fields.keys() == scan.fields.keys()
    assert all(np.array_equal(after.fields[key], scan.fields[key]) for key in scan.fields)
    assert after.crs == scan.crs
    assert replace(after.las, software="") == replace(scan.las, software="")


@pytest.mark.parametrize(
    ("name", "label", "units", "metres"),
    [
        ("formats/las/MixedConifer.laz", "EPSG:26912", "metre", (1, 1, 1)),
        ("formats/las/Topography.laz", "EPSG:2949", "metre", (1, 1, 1)),
        (
            "formats/las/autzen_trim.laz",
            "NAD_1983_HARN_Lambert_Conformal_Conic",
            "foot (0.3048 m)",
            (0.3048,) * 3,
        ),
        (
            "two_epochs_autzen/autzen-bmx-2023.las",
            "NAD83 / Oregon LCC (m) + NAVD88 height (ftUS) (EPSG:2991 + EPSG:6360)",
            "metre, heights in US survey foot (0.3048006 m)",
            (1, 1, 1200 / 3937),
        ),
    ],
)
def test_coordinate_systems_of_las_files_are_read(scan_data, name, label, units, metres):
    pytest.importorskip("laspy")
    scan = read_scan(scan_data / name)
    assert (scan.crs.label, scan.crs.unit_text) == (label, units)
    assert scan.metres_per_unit == metres


@pytest.mark.parametrize(
    "name", ["formats/pcd/vlp16.pcd", "hdl32_pair/source.ply", "formats/las/autzen_trim.las"]
)
def test_truncated_real_files_are_refused(scan_data, tmp_path, name):
    pytest.importorskip("laspy")
    data = (scan_data / name).read_bytes()
    rng = np.random.default_rng(1)
    ends = [*range(1, 60, 7), *rng.integers(60, len(data), 12), len(data) - 1]
    truncated = tmp_path / name.rpartition("/")[2]
    for end in ends:
        truncated.write_bytes(data[:end])
        with pytest.raises(FormatError):
            read_scan(truncated)


def test_vtk_files_of_libpointmatcher(scan_data):
    for path in _files(scan_data, "vtk/*.vtk", 3):
        lines = path.read_text().splitlines()
        count = int(lines[4].split()[1])
        rows = np.loadtxt(lines[5 : 5 + count], dtype=np.float32)
        assert np.array_equal(read_scan(path).points, rows)


def test_stations_of_e57_files_agree_with_pye57(scan_data, tmp_path):
    pye57 = pytest.importorskip("pye57")
    counts = {}
    for path in _files(scan_data, "formats/e57/*.e57", 6):
        scans = read_scans(path)
        counts[path.name] = [len(scan) for scan in scans]
        with pye57.E57(str(path)) as file:
            for k, scan in enumerate(scans):
                raw = file.read_scan_raw(k, ignore_unsupported_fields=True)
                xyz = np.stack([raw[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
                assert np.array_equal(scan.points, xyz)
                assert scan.station == file.get_header(k)["name"].value()
                for theirs, ours in (("colorRed", "red"), ("rowIndex", "row")):
                    assert (theirs in raw) == (ours in scan.fields)
                    if theirs in raw:
                        assert np.array_equal(scan.fields[ours], raw[theirs])
        poses = [Pose.from_step(np.arange(6.0) + k) for k in range(len(scans))]
        write_e57_poses(path, tmp_path / "moved.e57", poses)
        for scan, moved, pose in zip(scans, read_scans(tmp_path / "moved.e57"), poses, strict=True):
            assert np.array_equal(scan.points, moved.points)
            assert moved.file_from_station.is_close(pose, translation=0, rotation=1e-15)
        assert _binary_sections(path) == _binary_sections(tmp_path / "moved.e57")
    assert sorted(map(sum, counts.values())) == [2, 2, 4, 6, 6, 155_201]
    normals = read_scan(scan_data / "formats" / "e57" / "testWithNormals.e57")
    assert list(normals.fields) == ["nx", "ny", "nz"]
    shifted = read_scan(scan_data / "formats" / "e57" / "translationWithoutRotation.e57")
    assert shifted.file_from_station == Pose(np.eye(3), [4.0, 5.0, 6.0])
    with pytest.raises(FormatError, match="found 2 stations: 1 'B2 - Cloud'"):
        read_scan(scan_data / "formats" / "e57" / "A_B.e57")


def _binary_sections(path):
    """Return all before the XML section, without the header and the checksums."""
    data = path.read_bytes()
    logical = b"".join(data[k : k + 1020] for k in range(0, len(data), 1024))
    offset = int.from_bytes(data[24:32], "little")
    return logical[48 : offset // 1024 * 1020 + offset % 1024]


def test_packet_captures_bags_and_trajectories_are_refused(scan_data):
    for path in _files(scan_data, "formats/*/*.pcap", 6):
        with pytest.raises(FormatError, match=f"ouster-cli source {path} save"):
            read_scan(path)
    for path in _files(scan_data, "formats/mcap/*.mcap", 1):
        with pytest.raises(FormatError, match=r"ros2 run pcl_ros pointcloud_to_pcd"):
            read_scan(path)
    with pytest.raises(FormatError, match="poses of a trajectory"):
        read_scan(scan_data / "trajectories" / "kitti_ground_truth" / "04.txt")


def test_poses_of_public_data_sets(scan_data):
    for path in (
        *scan_data.glob("*/*reference_transform.txt"),
        scan_data / "hdl32_pair" / "T_target_source.txt",
        scan_data / "kitti_00" / "Tr_velo_to_cam0.txt",
    ):
        assert np.allclose(read_pose(path).matrix[:3], np.loadtxt(path)[:3], atol=1e-5)
    for name in ("trajectories/kitti_ground_truth/04.txt", "handheld_balm/poses.txt"):
        poses = read_kitti_poses(scan_data / name)
        rows = np.loadtxt(scan_data / name).reshape(-1, 3, 4)
        assert np.allclose([pose.matrix[:3] for pose in poses], rows, atol=1e-5)
    path = scan_data / "newer_college" / "continuous" / "traj.txt"
    times, poses = read_tum_poses(path)
    rows = np.loadtxt(path)
    assert np.array_equal(times, rows[:, 0])
    assert np.array_equal([pose.translation for pose in poses], rows[:, 1:4])
    for name in ("terrestrial_3dtk/scan000.pose", "handheld_balm/poses.txt"):
        with pytest.raises(FormatError, match="numbers of shape"):
            read_pose(scan_data / name)
    with pytest.raises(FormatError, match="line 1"):
        read_kitti_poses(scan_data / "kitti_00" / "poses_velo_gt.txt")


@pytest.mark.parametrize(
    ("name", "sensor"),
    [
        ("kitti_00/velodyne/000094.bin", "spinning lidar, about 64 beams"),
        ("hdl32_pair/source.ply", "spinning lidar, about 32 beams"),
        ("formats/pcd/xt16.pcd", "spinning lidar, about 16 beams"),
        ("formats/pcd/at128.pcd", "lidar with about"),
        ("car_cloud_pair/car_cloud400.csv", "scanner away from the origin"),
        ("formats/las/Topography.laz", "airborne scan or map tile"),
    ],
)
def test_the_sensor_is_guessed(scan_data, name, sensor):
    pytest.importorskip("laspy")
    assert describe_scan(scan_data / name).guesses.sensor.startswith(sensor)


def test_zeros_and_fields_of_real_scans_are_found(scan_data):
    ouster = describe_scan(scan_data / "rellis_offroad" / "000104.bin")
    assert (ouster.points, ouster.zeros) == (131_072, 53_364)
    tile = describe_scan(scan_data / "hdl32_pair" / "source.ply")
    assert tile.zeros == 5107
    packets = describe_scan(scan_data / "formats" / "pcd" / "vlp16.pcd")
    assert (packets.ring_field, packets.rings, packets.time_field) == ("channel", 15, "time_stamp")
