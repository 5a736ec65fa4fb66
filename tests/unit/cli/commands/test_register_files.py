"""Files that ``scanlock register`` writes: pose, clouds and report."""

import json

import numpy as np
import pytest

from scanlock.io import read_pose, read_scan, write_scan


@pytest.fixture(scope="module")
def cars(scans, tmp_path_factory):
    """The pair as PLY files with fields, and rows without a return."""
    folder = tmp_path_factory.mktemp("fields")
    rng = np.random.default_rng(0)
    for name in ("source", "target"):
        points = np.load(scans / f"{name}.npy")
        points[::100] = 0.0
        normals = rng.normal(size=points.shape).astype(np.float32)
        fields = {"intensity": rng.uniform(size=len(points)).astype(np.float32)}
        fields |= dict(zip(("nx", "ny", "nz"), normals.T, strict=True))
        write_scan(folder / f"{name}.ply", points, fields)
    return folder / "source.ply", folder / "target.ply"


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".las", ".npz", ".xyz"])
def test_aligned_and_merged_clouds_keep_every_field(scanlock, cars, tmp_path, ending):
    aligned, merged = tmp_path / f"aligned{ending}", tmp_path / f"merged{ending}"
    done = scanlock("register", *cars, "-o", tmp_path / "pose.txt", "--aligned", aligned,
                    "--merged", merged)  # fmt: skip
    assert (done.code, done.err) == (0, "")
    pose, source = read_pose(tmp_path / "pose.txt"), read_scan(cars[0])
    rows = (source.points != 0.0).any(axis=1)
    moved, both = read_scan(aligned), read_scan(merged)
    expected = pose.apply(source.points[rows])
    np.testing.assert_allclose(moved.points, expected, atol=1e-4)
    normals = np.stack([moved.fields[name] for name in ("nx", "ny", "nz")], axis=1)
    before = np.stack([source.fields[name][rows] for name in ("nx", "ny", "nz")], axis=1)
    np.testing.assert_allclose(normals, before @ pose.rotation.T, rtol=1e-4, atol=1e-5)
    intensity = "intensity_float" if ending == ".las" else "intensity"
    np.testing.assert_allclose(moved.fields[intensity], source.fields["intensity"][rows])
    numbers = np.asarray(both.fields["scan"])
    np.testing.assert_allclose(both.points[numbers == 1], expected, atol=1e-4)
    assert (numbers == 0).sum() == (read_scan(cars[1]).points != 0.0).any(axis=1).sum()
    colours = {"rgb"} if ending == ".pcd" else {"red", "green", "blue"}
    assert colours | {intensity} <= set(both.fields)


def test_a_pose_that_is_not_verified_is_written_only_where_it_can_say_so(scanlock, scans, tmp_path):
    files = {ending: tmp_path / f"pose{ending}" for ending in (".txt", ".npy", ".json")}
    cloud = tmp_path / "aligned.ply"
    pair = scans / "elsewhere.npy", scans / "target.npy"
    options = ("--method", "icp")
    for path in files.values():
        done = scanlock("register", *pair, *options, "-o", path, "--aligned", cloud)
        assert done.code == 2
        assert f"left out {cloud}" in done.out
    assert not cloud.exists()
    assert files[".txt"].read_text().startswith("# not verified: ")
    assert not files[".npy"].exists()
    assert json.loads(files[".json"].read_text())["status"] != "ok"
    refused = scanlock("apply", files[".txt"], scans / "elsewhere.npy", "-o", cloud)
    assert (refused.code, cloud.exists()) == (1, False)
    assert "--force" in refused.err
    forced = scanlock("apply", files[".txt"], scans / "elsewhere.npy", "-o", cloud, "--force")
    assert (forced.code, cloud.exists()) == (0, True)
    again = scanlock("register", *pair, *options, "-o", files[".npy"], "--force")
    assert (again.code, files[".npy"].exists()) == (2, True)


def test_without_correspondences_no_pose_is_printed_or_written(scanlock, scans, tmp_path):
    flat = np.random.default_rng(0).uniform(-20.0, 20.0, (3000, 3)) * [1.0, 1.0, 0.0]
    np.save(tmp_path / "flat.npy", flat)
    path = tmp_path / "pose.txt"
    pair = tmp_path / "flat.npy", scans / "target.npy"
    done = scanlock("register", *pair, "--method", "sgc-ndt-d2d", "-o", path)
    assert (done.code, path.exists()) == (2, False)
    assert done.out.startswith("no correspondences  ")
    assert "target from source" not in done.out
    assert f"left out {path}: the pose is not verified (no correspondences)" in done.out


@pytest.mark.parametrize("option", ["-o", "--aligned", "--merged", "--picture"])
def test_a_missing_folder_is_refused_before_the_work(scanlock, tmp_path, option):
    name = {"-o": "pose.txt", "--picture": "pair.png"}.get(option, "cloud.ply")
    path = tmp_path / "new" / name
    done = scanlock("register", "nowhere.bin", "nowhere.bin", option, path)
    assert (done.code, path.parent.exists()) == (1, False)
    assert f"{path.parent} is no folder" in done.err


def test_an_output_over_an_input_or_another_output_is_refused(scanlock, cars, tmp_path):
    over = scanlock("register", *cars, "--aligned", cars[0])
    assert (over.code, over.out) == (1, "")
    assert "would be overwritten" in over.err
    path = tmp_path / "both.ply"
    twice = scanlock("register", *cars, "--aligned", path, "--merged", path)
    assert (twice.code, path.exists()) == (1, False)
    assert "two outputs" in twice.err


def test_a_report_is_one_page_with_outcome_accuracy_pictures_and_settings(scanlock, cars, tmp_path):
    path = tmp_path / "report.html"
    done = scanlock("register", *cars, "--report", path, "--method", "gicp")
    assert done.out.endswith(f"wrote {path}\n")
    page = path.read_text("utf-8")
    for expected in (
        "source.ply onto target.ply",
        "<strong>ok</strong>",
        "at one sigma",
        "by axis",
        "pose",
        "[search]",
        "max_correspondence_distances",
    ):
        assert expected in page
    assert page.count("data:image/png;base64,") == 2
    assert "http" not in page
    again = tmp_path / "again.html"
    scanlock("register", *cars, "--report", again, "--method", "gicp")
    assert again.read_bytes() == path.read_bytes()
