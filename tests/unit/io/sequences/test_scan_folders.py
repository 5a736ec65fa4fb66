import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.errors import FormatError
from scanlock.io import write_kitti_poses, write_pose, write_scan, write_tum_poses
from scanlock.io.sequences.scan_folders import require_folder, scan_files

_POSES = [yaw_pose(0.1 * k, (1.0 * k, 0.5 * k, 0.0)) for k in range(12)]


def _graph(path):
    path.write_text("v0 0 0 0 0 0 0 1\nv1 -0.63 -0.88 -0.07 0 0 0.6 0.8\n")


def _numbered(path):
    write_kitti_poses(path, _POSES)
    lines = path.read_text().splitlines()
    path.write_text("".join(f"{k} {line}\n" for k, line in enumerate(lines)))


@pytest.mark.parametrize(
    "write",
    [
        lambda path: write_kitti_poses(path, _POSES),
        lambda path: write_tum_poses(path, np.arange(12.0), _POSES),
        lambda path: write_pose(path, _POSES[3]),
        lambda path: np.savetxt(path, _POSES[3].matrix[:3]),
        lambda path: np.savetxt(path, 0.1 * np.arange(2000.0)),
        _graph,
        _numbered,
    ],
    ids=["kitti", "tum", "matrix", "three rows", "times", "graph", "numbered"],
)
def test_text_files_of_poses_and_times_are_no_scans(tmp_path, write):
    write(tmp_path / "notes.txt")
    with pytest.raises(FormatError, match="found no scan files"):
        scan_files(tmp_path)
    write_scan(tmp_path / "0.txt", street(1, 100))
    assert scan_files(tmp_path) == (tmp_path / "0.txt",)


@pytest.mark.parametrize("width", [3, 4, 7, 8, 12])
def test_text_files_of_points_stay_scans(tmp_path, width):
    rng = np.random.default_rng(width)
    for k in range(3):
        np.savetxt(tmp_path / f"{k}.txt", rng.normal(0.0, 10.0, (4, width)))
    (tmp_path / "readme.txt").write_text("measured on a Monday\n")
    assert len(scan_files(tmp_path)) == 4


def test_the_root_of_a_data_set_names_its_sequences(tmp_path):
    for name in ("00", "01"):
        folder = tmp_path / "sequences" / name / "velodyne"
        folder.mkdir(parents=True)
        write_scan(folder / "000000.bin", street(1, 50))
    (tmp_path / "sequences" / "02" / "velodyne").mkdir(parents=True)
    for place in (tmp_path, tmp_path / "sequences"):
        with pytest.raises(FormatError, match=r"holds 2 sequences; name one: .*sequences/00, "):
            scan_files(place)


def test_a_folder_of_folders_with_one_scan_each_is_described(tmp_path):
    for k in range(5):
        folder = tmp_path / f"{k:06d}"
        folder.mkdir()
        write_scan(folder / "points.bin", street(1, 50))
        np.savetxt(folder / "pose.txt", _POSES[k].matrix)
    _graph(tmp_path / "graph.txt")
    with pytest.raises(FormatError, match=r"no scans here, but 5 subfolders with points\.bin"):
        scan_files(tmp_path)


def test_one_folder_of_scans_inside_is_named(tmp_path):
    (tmp_path / "clouds").mkdir()
    write_scan(tmp_path / "clouds" / "0.ply", street(1, 50))
    with pytest.raises(FormatError, match=r"name a folder that holds them: .*/clouds"):
        scan_files(tmp_path)


def test_captures_are_named(tmp_path):
    (tmp_path / "drive.pcap").write_bytes(b"\xd4\xc3\xb2\xa1" + bytes(100))
    (tmp_path / "drive.json").write_text("{}")
    with pytest.raises(FormatError, match=r"no scans here, but drive\.pcap, a capture"):
        scan_files(tmp_path)
    with pytest.raises(FormatError, match="found a pcap packet capture"):
        require_folder(tmp_path / "drive.pcap")


def test_a_file_is_no_folder(tmp_path):
    write_scan(tmp_path / "0.ply", street(1, 50))
    with pytest.raises(FormatError, match="expected a folder of scans, found a file"):
        require_folder(tmp_path / "0.ply")
    require_folder(tmp_path)


def test_endings_of_one_format_are_listed_together(tmp_path):
    for name in ("10.laz", "2.las", "1.LAZ"):
        (tmp_path / name).write_bytes(b"LASF")
    (tmp_path / "notes.txt").write_text("measured on a Monday\n")
    assert [path.name for path in scan_files(tmp_path)] == ["1.LAZ", "2.las", "10.laz"]
    (tmp_path / "2.laz").write_bytes(b"LASF")
    with pytest.raises(FormatError, match=r"each scan once, found 2\.las and 2\.laz"):
        scan_files(tmp_path)
    (tmp_path / "3.ply").write_bytes(b"ply\n")
    with pytest.raises(FormatError, match=r"found files of \.las, \.laz, \.ply"):
        scan_files(tmp_path)
