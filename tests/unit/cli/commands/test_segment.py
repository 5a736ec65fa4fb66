import json

import numpy as np
import pytest

from scanlock import segment
from scanlock.cli.commands.segment import semantic_kitti_labels
from scanlock.errors import InvalidInput
from scanlock.io import CoordinateSystem, ScanFile, read_labels, read_scan, write_scan
from scanlock.report.label_colours import label_colours


@pytest.fixture(scope="module")
def expected(scans):
    """Labels of the scan with invalid rows, without its points at the sensor."""
    points = np.array(read_scan(scans / "invalid_rows.pcd").points)
    points[(points == 0.0).all(axis=1)] = np.nan
    return segment(points).labels


@pytest.mark.parametrize("ending", [".npy", ".txt", ".csv"])
def test_labels_follow_the_rows_of_the_file(scanlock, scans, tmp_path, expected, ending):
    path = tmp_path / f"labels{ending}"
    done = scanlock("segment", scans / "invalid_rows.pcd", "-o", path)
    assert (done.code, done.err) == (0, "")
    labels = read_labels(path, count=6000)
    np.testing.assert_array_equal(labels, expected)
    assert (labels[::10] == -1).all()
    assert (labels[5::10] == -1).all()
    assert labels.max() > 10
    assert f"wrote {path}" in done.out


def test_semantic_kitti_labels_contain_class_and_instance(scanlock, scans, tmp_path, expected):
    path = tmp_path / "scan.label"
    assert scanlock("segment", scans / "invalid_rows.pcd", "-o", path).code == 0
    packed = read_labels(path, count=6000)
    kind, instance = packed & 0xFFFF, packed >> 16
    np.testing.assert_array_equal(kind, np.select([expected == 0, expected > 0], [49, 99], 0))
    np.testing.assert_array_equal(instance, np.maximum(expected, 0))


def test_more_clusters_than_semantic_kitti_allows_are_refused():
    assert semantic_kitti_labels(np.array([65535]))[0] == 65535 * 65536 + 99
    with pytest.raises(InvalidInput, match=r"65535 clusters, got 65536; write \.npy"):
        semantic_kitti_labels(np.array([0, 65536]))


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".npz"])
def test_a_scan_is_written_with_its_fields_and_labels(scanlock, scans, tmp_path, expected, ending):
    path = tmp_path / f"scan{ending}"
    assert scanlock("segment", scans / "invalid_rows.pcd", "-o", path).code == 0
    before, after = read_scan(scans / "invalid_rows.pcd"), read_scan(path)
    np.testing.assert_array_equal(after.points, before.points)
    np.testing.assert_array_equal(after.fields["intensity"], before.fields["intensity"])
    np.testing.assert_array_equal(after.fields["label"], expected)
    assert after.height == (before.height if ending == ".pcd" else 1)


def test_map_coordinates_keep_their_precision(scanlock, scans, tmp_path):
    pytest.importorskip("laspy")
    far = np.array([4e5, 5e6, 100.0]) + np.load(scans / "target.npy").round(3)
    write_scan(tmp_path / "survey.las", far)
    done = scanlock("segment", tmp_path / "survey.las", "-o", tmp_path / "labelled.laz")
    assert (done.code, done.err) == (0, "")
    after = read_scan(tmp_path / "labelled.laz")
    assert np.abs(after.points - read_scan(tmp_path / "survey.las").points).max() < 1e-3
    np.testing.assert_array_equal(after.fields["label"], segment(after.points).labels)


def test_an_existing_label_field_is_kept(scanlock, scans, tmp_path):
    first, second = tmp_path / "first.ply", tmp_path / "second.ply"
    scanlock("segment", scans / "invalid_rows.pcd", "-o", first)
    done = scanlock("segment", first, "-o", second)
    fields = read_scan(second).fields
    np.testing.assert_array_equal(fields["label"], fields["scanlock_label"])
    assert "field scanlock_label: 0 ground" in done.out


def test_the_summary_counts_every_row_once(scanlock, scans, expected):
    summary = json.loads(scanlock("segment", scans / "invalid_rows.pcd", "--json").out)
    counts = [summary[f"{kind}_points"] for kind in ("ground", "cluster", "left_out")]
    assert counts == [(expected == 0).sum(), (expected > 0).sum(), (expected == -1).sum()]
    assert summary["points"] == sum(counts) == 6000
    assert summary["clusters"] == expected.max()
    assert summary["sensor_height_m"] == pytest.approx(1.7, abs=0.05)
    assert summary["ground_status"] == "found"
    text = " ".join(scanlock("segment", scans / "invalid_rows.pcd").out.split())
    assert f"ground {counts[0]:,} points" in text
    assert f"clusters {summary['clusters']} of" in text


def test_a_scan_without_ground_is_reported(scanlock, tmp_path):
    ball = np.random.default_rng(0).normal(size=(3000, 3)) * 5.0
    np.save(tmp_path / "ball.npy", ball)
    done = scanlock("segment", tmp_path / "ball.npy")
    assert done.code == 0
    assert "0 points, 0.0 %" in done.out
    assert "none: " in done.out
    summary = json.loads(scanlock("segment", tmp_path / "ball.npy", "--json").out)
    assert summary["sensor_height_m"] is None


def test_a_picture_is_drawn(scanlock, scans, tmp_path):
    path = tmp_path / "scan.svg"
    done = scanlock("segment", scans / "invalid_rows.pcd", "--picture", path)
    assert path.read_text().startswith("<?xml")
    assert done.out.endswith(f"wrote {path}\n")


def test_an_unknown_extension_is_refused_before_the_work(scanlock, tmp_path):
    done = scanlock("segment", "nowhere.bin", "-o", tmp_path / "scan.lable")
    assert done.code == 1
    assert "did you mean .label?" in done.err


def test_the_input_scan_is_never_overwritten(scanlock, tmp_path):
    path = tmp_path / "scan.npy"
    np.save(path, np.random.default_rng(0).normal(size=(500, 3)))
    before = path.read_bytes()
    done = scanlock("segment", path, "-o", tmp_path / "." / "scan.npy")
    assert done.code == 1
    assert "would be overwritten; use another name" in done.err
    assert path.read_bytes() == before


@pytest.mark.parametrize("option", ["-o", "--picture"])
def test_no_folder_is_made(scanlock, scans, tmp_path, option):
    path = tmp_path / "new" / ("scan.ply" if option == "-o" else "scan.png")
    done = scanlock("segment", scans / "target.npy", option, path)
    assert done.code == 1
    assert f"{path.parent} is no folder" in done.err
    assert not path.parent.exists()


def test_settings_change_the_segmentation(scanlock, scans, tmp_path):
    path = tmp_path / "mine.toml"
    assert scanlock("settings", "segment", "-o", path).code == 0
    plain = scanlock("segment", scans / "target.npy", "--json").out
    assert scanlock("segment", scans / "target.npy", "--json", "--settings", path).out == plain
    path.write_text("[clusters]\nmin_points = 200\n")
    few = json.loads(scanlock("segment", scans / "target.npy", "--json", "--settings", path).out)
    assert few["clusters"] < json.loads(plain)["clusters"]
    path.write_text("[clusters]\nmin_pionts = 200\n")
    done = scanlock("segment", scans / "target.npy", "--settings", path)
    assert (done.code, "did you mean min_points?" in done.err) == (1, True)


@pytest.mark.parametrize("ending", [".ply", ".pcd"])
def test_colours_follow_the_labels(scanlock, scans, tmp_path, ending):
    path = tmp_path / f"scan{ending}"
    scanlock("segment", scans / "invalid_rows.pcd", "-o", path)
    scan = read_scan(path)
    if ending == ".pcd":
        packed = scan.fields["rgb"].view(np.uint32)
        colours = np.stack([packed >> 16, packed >> 8 & 255, packed & 255], axis=1)
    else:
        colours = np.stack([scan.fields[name] for name in ("red", "green", "blue")], axis=1)
    np.testing.assert_array_equal(colours, label_colours(scan.fields["label"]))
    assert len(np.unique(colours, axis=0)) > 10
    scanlock("segment", scans / "invalid_rows.pcd", "-o", path, "--no-colours")
    assert set(read_scan(path).fields) == {"intensity", "label"}


def _airborne(path, points, is_ground):
    """Write a classified LAS 1.2 file in feet."""
    crs = CoordinateSystem.from_wkt('PROJCS["x",UNIT["foot",0.3048],AUTHORITY["EPSG","2994"]]')
    classes = np.where(is_ground, 2, 5).astype(np.uint8)
    classes[:40] = 7
    scan = ScanFile(points=points, fields={"classification": classes}, format="las", crs=crs)
    write_scan(path, scan)
    return classes


def test_ground_is_class_2_of_las(scanlock, scans, tmp_path):
    pytest.importorskip("laspy")
    points = np.load(scans / "target.npy")
    is_ground = segment(points).is_ground
    # One ground point in ten is called something else by the file.
    classes = _airborne(tmp_path / "a.las", points, is_ground & (np.arange(len(points)) % 10 > 0))
    done = scanlock("segment", tmp_path / "a.las", "-o", tmp_path / "b.laz")
    assert (done.code, done.err) == (0, "")
    after = read_scan(tmp_path / "b.laz")
    labels = after.fields["label"]
    np.testing.assert_array_equal(after.fields["classification"], np.where(labels == 0, 2, 1))
    np.testing.assert_array_equal(after.fields["original_classification"], classes)
    assert (after.crs.epsg, after.crs.horizontal_unit) == (2994, "foot")
    summary = json.loads(scanlock("segment", tmp_path / "a.las", "--json").out)["file_ground"]
    used = classes != 7
    stated, found = classes[used] == 2, labels[used] == 0
    assert summary["points"] == stated.sum()
    assert summary["agreement"] == pytest.approx((stated == found).mean())
    assert summary["precision"] == pytest.approx(0.9, abs=0.03)
    assert summary["recall"] > 0.97
    text = " ".join(done.out.split())
    assert f"class 2 {summary['points']:,} points of the file: " in text
    assert "note converted to metres from foot (0.3048 m)" in text
    assert "class 2" not in scanlock("segment", scans / "target.npy").out


@pytest.mark.parametrize("value", [np.nan, 0.0])
def test_a_scan_without_a_valid_point_names_its_file(scanlock, tmp_path, value):
    np.save(tmp_path / "empty.npy", np.full((100, 3), value))
    done = scanlock("segment", tmp_path / "empty.npy")
    assert (done.code, done.out) == (1, "")
    assert done.err.startswith(f"scanlock: {tmp_path / 'empty.npy'}: none of its 100 points")
