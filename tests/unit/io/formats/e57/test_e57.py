import importlib.util
import sys

import numpy as np
import pytest

from scanlock.errors import FormatError, InvalidInput, MissingExtra
from scanlock.geometry.pose import Pose
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation
from scanlock.io import (
    ScanFile,
    describe_scan,
    read_scan,
    read_scans,
    write_e57_poses,
    write_scan,
    write_scans,
)

needs_pye57 = pytest.mark.skipif(importlib.util.find_spec("pye57") is None, reason="needs pye57")

_N = 12
_RNG = np.random.default_rng(0)
_POINTS = _RNG.normal(size=(_N, 3)) * 20
_POSES = [Pose.from_step(_RNG.normal(size=6) * [9, 9, 2, 1, 1, 1]) for _ in range(3)]
_FIELDS = {
    "intensity": _RNG.random(_N).astype(np.float32),
    "red": _RNG.integers(0, 256, _N, dtype=np.uint8),
    "green": _RNG.integers(0, 256, _N, dtype=np.uint8),
    "blue": _RNG.integers(0, 256, _N, dtype=np.uint8),
    "row": np.arange(_N, dtype=np.uint16) % 4,
    "column": np.arange(_N, dtype=np.int32) // 4,
    "nx": np.ones(_N),
    "label": _RNG.integers(-(2**63), 2**63 - 1, _N, dtype=np.int64),
    "range_noise": np.where(np.arange(_N) == 3, np.nan, 0.1),
}


def _pye57_file(path, stations):
    """Write (name, points, pose) with pye57 alone."""
    import pye57

    with pye57.E57(str(path), mode="w") as file:
        for name, points, pose in stations:
            data = {f"cartesian{axis}": points[:, k] for k, axis in enumerate("XYZ")}
            data["intensity"] = np.linspace(0, 1, len(points))
            data["cartesianInvalidState"] = (np.arange(len(points)) == 2).astype(np.int8)
            file.write_scan_raw(
                data,
                name=name,
                rotation=quaternion_from_rotation(pose.rotation),
                translation=pose.translation,
            )
    return path


def _stations(path):
    return _pye57_file(
        path, [(f"S{k}", _POINTS[: 5 + k], pose) for k, pose in enumerate(_POSES, 1)]
    )


@needs_pye57
def test_stations_of_pye57_are_read_in_their_own_frames(tmp_path):
    path = _stations(tmp_path / "site.e57")
    scans = read_scans(path)
    assert [scan.station for scan in scans] == ["S1", "S2", "S3"]
    for k, (scan, pose) in enumerate(zip(scans, _POSES, strict=True), 1):
        expected = _POINTS[: 5 + k].astype(np.float32).astype(np.float64)
        expected[2] = np.nan
        assert np.array_equal(scan.points, expected, equal_nan=True)
        assert scan.file_from_station.is_close(pose, translation=1e-12, rotation=1e-12)
        assert scan.fields["invalid"].tolist() == [0, 0, 1] + [0] * (2 + k)
        assert scan.notes == ("1 points marked invalid in the file read as NaN",)
        assert scan.viewpoint is None


@needs_pye57
def test_a_station_is_chosen_by_number_and_by_name(tmp_path):
    path = _stations(tmp_path / "site.e57")
    for chosen in (
        read_scan(path, station=2),
        read_scan(path, station="S2"),
        read_scan(f"{path}#2"),
        read_scan(f"{path}#S2"),
    ):
        assert (chosen.station, len(chosen)) == ("S2", 7)
    with pytest.raises(FormatError, match=r"found 3 stations: 1 'S1' \(6 points\), 2 'S2' \(7 poi"):
        read_scan(path)
    for station in (0, 4, -1, "S4"):
        with pytest.raises(InvalidInput, match="station must be a number from 1 to 3, or a name"):
            read_scan(path, station=station)
    description = describe_scan(f"{path}#3")
    assert (description.points, description.size) == (8, path.stat().st_size)
    assert description.station == "S3"
    assert np.allclose(description.file_from_station, _POSES[2].matrix, atol=1e-12)


@needs_pye57
def test_formats_with_one_scan_have_no_station(tmp_path):
    write_scan(tmp_path / "a.pcd", _POINTS)
    with pytest.raises(InvalidInput, match="station must be left out for PCD"):
        read_scan(tmp_path / "a.pcd", station=1)
    write_scan(tmp_path / "a#2.pcd", _POINTS)
    assert len(read_scan(tmp_path / "a#2.pcd")) == _N
    with pytest.raises(FileNotFoundError, match=r"b\.e57#2"):
        read_scan(tmp_path / "b.e57#2")
    assert len(read_scans(tmp_path / "a.pcd")) == 1


@needs_pye57
@pytest.mark.parametrize("dtype", ["f4", "f8"])
def test_round_trip_of_several_stations(tmp_path, dtype):
    path = tmp_path / "a.e57"
    points = _POINTS.astype(dtype)
    points[4], points[5, 1] = np.nan, np.inf
    scans = [
        ScanFile(
            points=points.astype(np.float64),
            fields=_FIELDS,
            format="pcd",
            coordinate_dtype=np.dtype(dtype).name,
            station=name,
            file_from_station=pose,
        )
        for name, pose in (("Hall", _POSES[0]), ("Hof Süd", _POSES[1]), ("", None))
    ]
    write_scans(path, scans)
    again = read_scans(path)
    assert [scan.station for scan in again] == ["Hall", "Hof Süd", "Station 3"]
    assert again[2].file_from_station is None
    expected = points.astype(np.float64)
    expected[4:6] = np.nan
    for one, scan in zip(scans, again, strict=True):
        assert np.array_equal(scan.points, expected, equal_nan=True)
        assert scan.coordinate_dtype == one.coordinate_dtype
        assert set(scan.fields) == {*_FIELDS, "invalid"}
        for name, values in _FIELDS.items():
            assert scan.fields[name].dtype == values.dtype
            assert np.array_equal(scan.fields[name], values, equal_nan=values.dtype.kind == "f")
    for one, scan in zip(scans[:2], again, strict=False):
        assert scan.file_from_station.is_close(one.file_from_station, translation=0, rotation=1e-15)


@needs_pye57
def test_written_files_are_read_by_pye57(tmp_path):
    import pye57

    scan = ScanFile(
        points=_POINTS,
        fields={name: _FIELDS[name] for name in ("intensity", "red", "green", "blue")},
        format="pcd",
        station="Hall",
        file_from_station=_POSES[0],
    )
    write_scans(tmp_path / "a.e57", [scan])
    with pye57.E57(str(tmp_path / "a.e57")) as file:
        data = file.read_scan(0, intensity=True, colors=True, transform=True,
                              ignore_missing_fields=True)  # fmt: skip
        name = file.get_header(0)["name"].value()
    moved = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    assert np.abs(moved - _POSES[0] @ _POINTS).max() < 1e-12
    assert np.array_equal(data["colorGreen"], _FIELDS["green"])
    assert np.array_equal(data["intensity"], _FIELDS["intensity"])
    assert name == "Hall"


@needs_pye57
def test_ranges_and_angles_are_converted(tmp_path):
    from pye57 import libe57

    path = tmp_path / "a.e57"
    write_scans(path, [ScanFile(points=_POINTS, fields={}, format="pcd")])
    distance = np.linalg.norm(_POINTS, axis=1)
    azimuth = np.arctan2(_POINTS[:, 1], _POINTS[:, 0])
    elevation = np.arcsin(_POINTS[:, 2] / distance)
    file = libe57.ImageFile(str(path), "w")
    file.extensionsAdd("", libe57.E57_V1_0_URI)
    file.root().set("data3D", libe57.VectorNode(file, True))
    file.root().set("coordinateMetadata", libe57.StringNode(file, "EPSG:25832"))
    prototype, buffers = libe57.StructureNode(file), libe57.VectorSourceDestBuffer()
    columns = {
        "sphericalRange": distance,
        "sphericalAzimuth": azimuth,
        "sphericalElevation": elevation,
        "sphericalInvalidState": np.where(np.arange(_N) == 1, 2, 0).astype(np.int8),
    }
    for name, values in columns.items():
        is_state = values.dtype == np.int8
        kind = libe57.IntegerNode if is_state else libe57.FloatNode
        bounds = {"minimum": 0, "maximum": 2} if is_state else {}
        prototype.set(name, kind(file, 0, **bounds))
        buffers.append(libe57.SourceDestBuffer(file, name, values, _N, True, True))
    scan = libe57.StructureNode(file)
    points = libe57.CompressedVectorNode(file, prototype, libe57.VectorNode(file, True))
    scan.set("points", points)
    file.root()["data3D"].append(scan)
    writer = points.writer(buffers)
    writer.write(_N)
    writer.close()
    file.close()
    read = read_scan(path)
    assert np.isnan(read.points[1]).all()
    kept = np.arange(_N) != 1
    assert np.abs(read.points[kept] - _POINTS[kept]).max() < 1e-12
    assert read.notes[:2] == (
        "coordinate system of the poses: EPSG:25832",
        "converted from ranges and angles",
    )
    assert read.fields["invalid"].tolist() == [0, 2] + [0] * (_N - 2)


@needs_pye57
def test_columns_are_chosen_by_name(tmp_path):
    path = _stations(tmp_path / "site.e57")
    scan = read_scan(path, columns="x y z i=intensity", station=1)
    assert list(scan.fields) == ["i"]
    with pytest.raises(InvalidInput, match="must be names of E57"):
        read_scan(path, columns=4, station=1)


@needs_pye57
@pytest.mark.parametrize(
    ("fields", "complaint"),
    [
        ({"a-b": np.ones(_N)}, "letters, digits and underscores"),
        ({"two words": np.ones(_N)}, "one word"),
        ({"hash": np.full(_N, 2**63, np.uint64)}, "below 2\\^63"),
        ({"word": np.full(_N, "a")}, "cannot hold field word"),
    ],
)
def test_fields_that_e57_cannot_hold_are_not_written(tmp_path, fields, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        write_scan(tmp_path / "a.e57", _POINTS, fields)
    assert list(tmp_path.iterdir()) == []


@needs_pye57
def test_truncated_and_damaged_files_are_refused(tmp_path):
    path = _pye57_file(tmp_path / "a.e57", [("S1", _POINTS, _POSES[0])])
    data = path.read_bytes()
    damaged = tmp_path / "b.e57"
    for end in [*range(1, 60), *range(60, len(data), 13), len(data) - 1]:
        damaged.write_bytes(data[:end])
        with pytest.raises(FormatError):
            read_scan(damaged)
    rng = np.random.default_rng(1)
    used = int.from_bytes(data[24:32], "little") + int.from_bytes(data[32:40], "little")
    for at in [*range(48), *rng.integers(48, used, 100)]:
        changed = bytearray(data)
        changed[at] ^= 1 << int(rng.integers(8))
        damaged.write_bytes(changed)
        with pytest.raises(FormatError):
            read_scan(damaged)


@needs_pye57
def test_other_poses_leave_every_byte_of_the_points(tmp_path):
    path, output = _stations(tmp_path / "site.e57"), tmp_path / "moved.e57"
    before = path.read_bytes()
    poses = [_POSES[2], None, _POSES[0]]
    write_e57_poses(path, output, poses)
    assert path.read_bytes() == before
    again = read_scans(output)
    for scan, old, pose in zip(again, read_scans(path), poses, strict=True):
        assert np.array_equal(scan.points, old.points, equal_nan=True)
        expected = old.file_from_station if pose is None else pose
        assert scan.file_from_station.is_close(expected, translation=0, rotation=1e-15)
        assert scan.station == old.station
    assert _sections(before) == _sections(output.read_bytes())
    write_e57_poses(output, output, [_POSES[0], None, _POSES[2]])
    assert [scan.file_from_station.translation[0] for scan in read_scans(output)] == [
        pose.translation[0] for pose in _POSES
    ]


def _sections(data):
    """Return the binary sections of a file without checksums."""
    logical = b"".join(data[k : k + 1020] for k in range(0, len(data), 1024))
    offset = int.from_bytes(data[24:32], "little")
    return logical[48 : offset // 1024 * 1020 + offset % 1024]


@needs_pye57
def test_a_pose_is_inserted_where_a_station_has_none(tmp_path):
    scans = [ScanFile(points=_POINTS, fields=_FIELDS, format="pcd")] * 2
    write_scans(tmp_path / "a.e57", scans)
    write_e57_poses(tmp_path / "a.e57", tmp_path / "b.e57", [None, _POSES[1]])
    first, second = read_scans(tmp_path / "b.e57")
    assert first.file_from_station is None
    assert second.file_from_station.is_close(_POSES[1], translation=0, rotation=1e-15)


@needs_pye57
def test_the_images_of_a_station_move_with_it(tmp_path):
    from pye57 import libe57

    path, output = _stations(tmp_path / "site.e57"), tmp_path / "b.e57"
    image_poses = [Pose.from_step(_RNG.normal(size=6)) for _ in range(3)]
    source, file = libe57.ImageFile(str(path), "r"), libe57.ImageFile(str(output), "w")
    guids = [source.root()["data3D"][k]["guid"].value() for k in range(3)]
    source.close()
    file.extensionsAdd("", libe57.E57_V1_0_URI)
    for key, count in (("data3D", 3), ("images2D", 3)):
        file.root().set(key, libe57.VectorNode(file, True))
        for k in range(count):
            node = libe57.StructureNode(file)
            name = "guid" if key == "data3D" else "associatedData3DGuid"
            node.set(name, libe57.StringNode(file, guids[k]))
            pose = _POSES[k] if key == "data3D" else image_poses[k]
            node.set("pose", _pose_node(libe57, file, pose))
            file.root()[key].append(node)
    file.close()
    write_e57_poses(output, output, [None, _POSES[0], None])
    file = libe57.ImageFile(str(output), "r")
    moved = [_pose_of(file.root()["images2D"][k]["pose"]) for k in range(3)]
    file.close()
    expected = [image_poses[0], _POSES[0] @ _POSES[1].inverse() @ image_poses[1], image_poses[2]]
    for one, other in zip(moved, expected, strict=True):
        assert one.is_close(other, translation=1e-12, rotation=1e-12)


def _pose_node(libe57, file, pose):
    node = libe57.StructureNode(file)
    for key, axes, values in (
        ("rotation", "wxyz", quaternion_from_rotation(pose.rotation)),
        ("translation", "xyz", pose.translation),
    ):
        part = libe57.StructureNode(file)
        for axis, value in zip(axes, values, strict=True):
            part.set(axis, libe57.FloatNode(file, float(value)))
        node.set(key, part)
    return node


def _pose_of(node):
    translation = [node["translation"][axis].value() for axis in "xyz"]
    return pose_from_quaternion(translation, [node["rotation"][axis].value() for axis in "wxyz"])


@needs_pye57
def test_poses_of_large_files_keep_the_pages_before(tmp_path):
    points = np.random.default_rng(3).normal(size=(5000, 3))
    path = _pye57_file(tmp_path / "a.e57", [("S", points, _POSES[0])])
    write_e57_poses(path, tmp_path / "b.e57", [_POSES[1]])
    before, after = path.read_bytes(), (tmp_path / "b.e57").read_bytes()
    pages = int.from_bytes(before[24:32], "little") // 1024
    assert pages > 10
    assert before[1024 : 1024 * pages] == after[1024 : 1024 * pages]
    assert np.array_equal(
        read_scan(path).points, read_scan(tmp_path / "b.e57").points, equal_nan=True
    )


@needs_pye57
def test_the_xml_section_may_stand_before_others(tmp_path):
    path = _pye57_file(tmp_path / "a.e57", [("S", _POINTS, _POSES[0])])
    data = path.read_bytes() + bytes(1020) + b"\x1c\xde\x21\x67"
    from scanlock.io.formats.e57.pages import sealed

    pages = [data[k : k + 1020] for k in range(0, len(data), 1024)]
    pages[0] = pages[0][:16] + len(data).to_bytes(8, "little") + pages[0][24:]
    path.write_bytes(b"".join(map(sealed, pages)))
    write_e57_poses(path, tmp_path / "b.e57", [_POSES[1]])
    after = (tmp_path / "b.e57").read_bytes()
    assert after[1024 : len(data)] == path.read_bytes()[1024:]
    scan = read_scan(tmp_path / "b.e57")
    assert scan.file_from_station.is_close(_POSES[1], translation=0, rotation=1e-15)


@needs_pye57
def test_wrong_numbers_of_poses_and_damaged_sources_are_refused(tmp_path):
    path, output = _stations(tmp_path / "site.e57"), tmp_path / "b.e57"
    with pytest.raises(InvalidInput, match="one for each of the 3 stations, got 2"):
        write_e57_poses(path, output, _POSES[:2])
    data = path.read_bytes()
    for damaged in (data[:-1], data[:40], b"ply\n" + data, data[:-1000] + b"x" + data[-999:]):
        path.write_bytes(damaged)
        with pytest.raises(FormatError):
            write_e57_poses(path, output, _POSES)
    assert not output.exists()


def test_without_pye57_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pye57.libe57", None)
    (tmp_path / "a.e57").write_bytes(b"ASTM-E57" + bytes(2000))
    with pytest.raises(MissingExtra, match=r'pip install "scanlock\[e57\]"'):
        read_scan(tmp_path / "a.e57")
    with pytest.raises(MissingExtra, match=r'pip install "scanlock\[e57\]"'):
        write_scan(tmp_path / "b.e57", _POINTS)
    assert not (tmp_path / "b.e57").exists()


@needs_pye57
def test_stations_are_converted_to_ptx(tmp_path):
    write_scans(tmp_path / "a.ptx", read_scans(_stations(tmp_path / "site.e57")))
    for scan, pose in zip(read_scans(tmp_path / "a.ptx"), _POSES, strict=True):
        assert scan.points[2].tolist() == [0, 0, 0]
        assert scan.file_from_station.is_close(pose, translation=1e-12, rotation=1e-12)
