import json
import re
from dataclasses import replace

import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.io import read_pose
from scanlock.simulation import hdl_32e, simulate_scan
from scanlock.simulation.scenes.look_alikes import corridor


def _error(matrix, scans):
    return Pose.from_matrix(matrix).distance(Pose.from_matrix(np.load(scans / "truth.npy")))


@pytest.fixture(scope="module")
def pair(scans):
    return scans / "source.npy", scans / "target.npy"


def test_the_pose_maps_the_source_onto_the_target(scanlock, scans, pair):
    done = scanlock("register", *pair, "--json")
    assert (done.code, done.err) == (0, "")
    result = json.loads(done.out)
    metres, radians = _error(result["target_from_source"], scans)
    assert metres < 0.1
    assert radians < 0.01
    assert (result["status"], result["method"]) == ("ok", "auto")
    assert (result["source"], result["target"]) == tuple(map(str, pair))
    assert "history" not in result


def test_status_and_pose_are_printed_first_and_details_with_verbose(scanlock, pair):
    done = scanlock("register", *pair)
    lines = done.out.splitlines()
    assert lines[0] == "ok  source onto target"
    joined = " ".join(done.out.split())
    names = ["accuracy", "translation", "rotation", "overlap", "time"]
    assert [line.split()[0] for line in lines if re.match(r"  \w", line)] == names
    assert re.search(r"accuracy right with 99\.\d%; .* mm and .* deg at one sigma, weakest", joined)
    # Not indented, to copy into another tool.
    start = lines.index("target from source [m]:") + 1
    matrix = np.array([line.split() for line in lines[start : start + 4]], float)
    exact = json.loads(scanlock("register", *pair, "--json").out)["target_from_source"]
    np.testing.assert_allclose(matrix, exact, atol=6e-6)
    [turned] = [line.split() for line in lines if line.split()[:1] == ["rotation"]]
    assert (float(turned[1]), turned[2]) == (pytest.approx(np.degrees(0.15), abs=0.5), "deg:")
    assert "\x1b" not in done.out
    assert "inlier rmse" not in done.out
    details = " ".join(scanlock("register", *pair, "-v").out.split())
    assert f"source {pair[0]}, 6,000 points (moves)" in details
    assert f"target {pair[1]}, 6,000 points (stays)" in details
    assert re.search("deviations forward .* left .* up .* mm; roll .* pitch .* yaw .* deg", details)
    for name in ("reason", "method", "overlap", "score", "inlier rmse", "candidates"):
        assert f" {name} " in details
    for stage in ("check", "ground", "clusters", "cells", "align", "verification", "read"):
        assert f" {stage} " in details


def test_all_pose_files_have_full_precision(scanlock, pair, tmp_path):
    files = [tmp_path / f"pose{ending}" for ending in (".txt", ".npy", ".json")]
    printed = json.loads(scanlock("register", *pair, "--json", "-o", files[0]).out)
    for path in files[1:]:
        assert scanlock("register", *pair, "-o", path).code == 0
    matrix = np.array(printed["target_from_source"])
    np.testing.assert_array_equal(np.loadtxt(files[0]), matrix)
    np.testing.assert_array_equal(np.load(files[1]), matrix)
    saved = json.loads(files[2].read_text())
    np.testing.assert_array_equal(saved["target_from_source"], matrix)
    assert saved.keys() == printed.keys()


@pytest.mark.parametrize("ending", [".txt", ".npy", ".json"])
def test_a_written_pose_is_a_valid_initial_pose(scanlock, scans, pair, tmp_path, ending):
    path = tmp_path / f"pose{ending}"
    scanlock("register", *pair, "-o", path)
    again = scanlock("register", *pair, "--initial", path, "--json")
    assert again.code == 0
    # A start at the result converges to the same pose.
    metres, radians = read_pose(path).distance(
        Pose.from_matrix(json.loads(again.out)["target_from_source"])
    )
    assert metres < 1e-3
    assert radians < 1e-4


def test_dof_xy_yaw_keeps_height_roll_and_pitch(scanlock, pair):
    done = scanlock("register", *pair, "--dof", "xy+yaw", "--json")
    matrix = np.array(json.loads(done.out)["target_from_source"])
    np.testing.assert_allclose(matrix[2], [0.0, 0.0, 1.0, 0.0], atol=1e-9)
    assert np.abs(matrix[:2, 3]).max() > 0.01


def test_a_narrow_prior_keeps_the_initial_pose_and_a_wide_one_does_not(scanlock, pair, tmp_path):
    start = Pose.identity().retract(np.array([0.3, -0.2, 0.0, 0.0, 0.0, 0.02]))
    np.savetxt(tmp_path / "start.txt", start.matrix)
    moved = {}
    for name, prior in {"narrow": ("1e-5", "1e-4"), "wide": ("100", "90")}.items():
        done = scanlock(
            "register", *pair, "--initial", tmp_path / "start.txt", "--prior", *prior, "--json"
        )
        pose = Pose.from_matrix(json.loads(done.out)["target_from_source"])
        moved[name] = pose.distance(start)[0]
    without_prior = scanlock("register", *pair, "--initial", tmp_path / "start.txt", "--json")
    unconstrained = Pose.from_matrix(json.loads(without_prior.out)["target_from_source"]).distance(
        start
    )[0]
    assert moved["narrow"] < 1e-3 < 0.1 < unconstrained
    assert moved["wide"] == pytest.approx(unconstrained, abs=1e-3)


@pytest.mark.parametrize(
    ("prior", "message"),
    [
        (("0", "1"), "--prior must be positive, got 0.0 m"),
        (("1", "-2"), "--prior must be positive, got -2.0 deg"),
        (("1", "2"), "--prior needs --initial, the pose whose deviations it states"),
    ],
)
def test_a_prior_without_deviation_or_pose_is_refused(scanlock, pair, prior, message):
    done = scanlock("register", *pair, "--prior", *prior)
    assert (done.code, done.out) == (1, "")
    assert message in done.err


def test_the_word_identity_is_an_initial_pose(scanlock, pair):
    options = ("--initial", "identity", "--prior", "1e-5", "1e-4", "--json")
    matrix = json.loads(scanlock("register", *pair, *options).out)["target_from_source"]
    assert np.abs(np.array(matrix) - np.eye(4)).max() < 1e-3


def test_options_have_no_empty_form(scanlock, pair):
    done = scanlock("register", *pair, "--empty-prior")
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    assert "--empty-prior" in done.err


def test_the_covariance_is_estimated_unless_switched_off(scanlock, pair):
    found = json.loads(scanlock("register", *pair, "--json").out)
    assert found["covariance"]["method"] == "sandwich"
    assert np.linalg.eigvalsh(found["covariance"]["matrix"]).min() > 0.0
    assert found["accuracy"]["translation_m"].keys() == {"forward", "left", "up"}
    without = scanlock("register", *pair, "--covariance", "none", "--json").out
    assert json.loads(without)["covariance"] is None


def test_fix_degenerate_keeps_the_initial_pose_along_a_corridor(scanlock, tmp_path):
    world, rng = corridor(), np.random.default_rng(0)
    sensor = replace(hdl_32e(), azimuth_steps=720)
    for name, ahead in (("target", 0.0), ("source", 0.5)):
        pose = Pose(np.eye(3), np.array([ahead, 0.0, 1.2]))
        np.save(tmp_path / f"{name}.npy", simulate_scan(world, sensor, pose, rng).points)
    np.savetxt(tmp_path / "start.txt", Pose(np.eye(3), np.array([2.0, 0.0, 0.0])).matrix)
    files = tmp_path / "source.npy", tmp_path / "target.npy"
    start = "--initial", tmp_path / "start.txt"
    done = scanlock("register", *files, *start, "--method", "gicp", "--fix-degenerate", "--json")
    found = json.loads(done.out)
    assert (done.code, found["status"]) == (2, "degenerate")
    assert found["target_from_source"][0][3] == pytest.approx(2.0, abs=1e-3)
    refused = scanlock("register", *files, "--fix-degenerate")
    assert (refused.code, refused.out) == (1, "")
    assert "give prior or initial" in refused.err


@pytest.mark.slow
def test_a_failed_registration_prints_its_result_and_exits_with_2(scanlock, scans, tmp_path):
    path = tmp_path / "pose.json"
    done = scanlock("register", scans / "elsewhere.npy", scans / "target.npy", "-o", path)
    assert (done.code, done.err) == (2, "")
    saved = json.loads(path.read_text())
    assert saved["status"] != "ok"
    assert done.out.startswith(saved["status"].replace("_", " ") + "  ")
    assert saved["reason"] in " ".join(done.out.split())


def test_a_failed_registration_prints_json(scanlock, scans, tmp_path):
    flat = np.random.default_rng(0).uniform(-20.0, 20.0, (3000, 3)) * [1.0, 1.0, 0.0]
    np.save(tmp_path / "flat.npy", flat)
    options = ("--method", "sgc-ndt-d2d", "--json")
    done = scanlock("register", tmp_path / "flat.npy", scans / "target.npy", *options)
    assert done.code == 2
    result = json.loads(done.out)
    assert result["status"] == "no_correspondences"
    assert result["metrics"]["overlap"] is None


def test_verbose_prints_every_evaluation_of_every_run(scanlock, pair):
    done = scanlock("register", *pair, "--verbose", "--method", "sgc-ndt-d2d")
    table = done.out[done.out.index("  run  ") :].splitlines()
    assert " ".join(table[0].split()) == "run evaluation value step [m] gradient accepted"
    rows = [line.split() for line in table[1:]]
    assert [int(row[1]) for row in rows] == list(range(1, len(rows) + 1))
    runs = [int(row[0]) for row in rows]
    assert runs == np.cumsum([float(row[3]) == 0.0 for row in rows]).tolist()
    assert runs[-1] >= 5  # at least one per scale
    full = json.loads(
        scanlock("register", *pair, "--verbose", "--json", "--method", "sgc-ndt-d2d").out
    )
    assert len(full["history"]) == full["evaluations"] == len(rows)
    assert [step["run"] for step in full["history"]] == runs


def test_a_method_is_selected_by_name(scanlock, pair):
    done = scanlock("register", *pair, "--method", "sgc-ndt-p2d", "--json")
    assert json.loads(done.out)["method"] == "sgc-ndt-p2d"


def test_rows_without_a_return_are_ignored(scanlock, scans):
    done = scanlock("register", scans / "invalid_rows.pcd", scans / "target.npy", "--json")
    assert done.code == 0
    matrix = np.array(json.loads(done.out)["target_from_source"])
    assert np.abs(matrix - np.eye(4)).max() < 0.02
    text = " ".join(
        scanlock("register", scans / "invalid_rows.pcd", scans / "target.npy", "-v").out.split()
    )
    assert "6,000 points, 600 of them blank (0, 0, 0) (moves)" in text


def test_motion_in_map_coordinates_is_that_of_the_centroid(scanlock, scans, tmp_path):
    far = np.array([500_000.0, 5_400_000.0, 100.0])
    for name in ("source", "target"):
        np.save(tmp_path / f"{name}.npy", np.load(scans / f"{name}.npy") + far)
    done = scanlock("register", tmp_path / "source.npy", tmp_path / "target.npy", "-o",
                    tmp_path / "pose.txt", "-v")  # fmt: skip
    assert done.code == 0
    moved = next(line for line in done.out.splitlines() if line.split()[:1] == ["translation"])
    assert float(moved.split()[1]) < 4.0
    joined = " ".join(done.out.split())
    assert "at the centroid, 50" in joined
    # Deviations of millimetres at the scene, not those at the far zero of the map.
    [east, north, up] = re.search("east (.*), north (.*), up (.*) mm; about east", joined).groups()
    assert max(float(east), float(north), float(up)) < 100.0
    scan = np.load(tmp_path / "source.npy")
    transformed = read_pose(tmp_path / "pose.txt").apply(scan)
    truth = Pose.from_matrix(np.load(scans / "truth.npy"))
    expected = truth.apply(np.load(scans / "source.npy")) + far
    assert np.abs(transformed - expected).max() < 0.3
    # The printed matrix, applied by another tool in double precision.
    matrix_text = joined.split("target from source [m]: ")[1].split()[:16]
    printed = np.array(matrix_text, float).reshape(4, 4)[:3]
    assert np.abs(scan @ printed[:, :3].T + printed[:, 3] - transformed).max() < 1e-3
    origins = joined.split("between source and target minus ")[1]
    numbers = re.findall(r"-?[\d.]+", origins)[:18]
    source_origin, target_origin = np.array(numbers[:6], float).reshape(2, 3)
    local = np.array(numbers[6:], float).reshape(3, 4)
    moved = (scan - source_origin) @ local[:, :3].T + local[:, 3] + target_origin
    assert np.abs(moved - transformed).max() < 1e-3


@pytest.mark.slow
def test_a_picture_is_drawn(scanlock, pair, tmp_path):
    path = tmp_path / "pair.png"
    done = scanlock("register", *pair, "--picture", path)
    assert path.read_bytes().startswith(b"\x89PNG")
    assert done.out.endswith(f"wrote {path}\n")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("option", "name", "parts"),
    [
        ("-o", "pose.jsn", [".txt, .json, .npy", "did you mean .json?"]),
        ("-o", "pose", [".txt, .json, .npy"]),
        ("--picture", "pair.jpeg", [".png, .pdf, .svg"]),
    ],
)
def test_an_unknown_extension_is_refused_before_the_work(scanlock, tmp_path, option, name, parts):
    done = scanlock("register", "nowhere.bin", "nowhere.bin", option, tmp_path / name)
    assert done.code == 1
    assert all(part in done.err for part in parts)
    assert "nowhere" not in done.err


def test_a_picture_without_matplotlib_names_the_missing_extra(
    scanlock, monkeypatch, pair, tmp_path
):
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = scanlock("register", *pair, "--picture", tmp_path / "pair.png")
    assert (done.code, done.out) == (1, "")
    assert 'pip install "scanlock[figures]"' in done.err


@pytest.mark.parametrize(
    ("name", "parts"),
    [
        ("tarrget.npy", ["no such scan file", "did you mean target.npy?"]),
        ("cut.bin", ["cut.bin: "]),
        ("noise.ply", ["noise.ply: "]),
        (".", ["found a folder"]),
    ],
)
def test_an_invalid_file_is_an_error_of_one_line_with_a_remedy(scanlock, scans, name, parts):
    done = scanlock("register", scans / name, scans / "target.npy")
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    assert all(part in done.err for part in parts)


def test_an_invalid_initial_pose_names_its_file(scanlock, pair, tmp_path):
    path = tmp_path / "guess.txt"
    path.write_text("1 2 3\n4 5 6\n")
    done = scanlock("register", *pair, "--initial", path)
    assert done.code == 1
    assert str(path) in done.err


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".txt", ".npy", ".json"])
def test_an_initial_pose_with_few_digits_is_corrected_and_noted(
    scanlock, scans, pair, tmp_path, ending
):
    notes = {}
    for digits in (3, 17):
        path = tmp_path / f"guess{digits}{ending}"
        matrix = np.load(scans / "truth.npy").round(digits)
        if ending == ".txt":
            np.savetxt(path, matrix, fmt="%.17g")
        elif ending == ".npy":
            np.save(path, matrix)
        else:
            path.write_text(json.dumps({"target_from_source": matrix.tolist()}))
        done = scanlock("register", *pair, "--initial", path, "--json")
        assert done.code == 0
        found = json.loads(done.out)["notes"]
        notes[digits] = [note for note in found if note.startswith("initial: ")]
    assert not notes[17]
    [note] = notes[3]
    assert 1e-5 < float(note.split(" was ")[1].split()[0]) < 1e-3
    printed = scanlock("register", *pair, "--initial", tmp_path / f"guess3{ending}").out
    assert f"note {note}" in " ".join(printed.split())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (np.diag([1.1, 1.1, 1.1, 1.0]), "it is scaled by 1.1"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "it is mirrored"),
        (np.diag([1.0, 1.05, 1.0, 1.0]), "it is sheared"),
    ],
)
def test_an_initial_pose_far_from_a_rotation_is_refused(
    scanlock, scans, pair, tmp_path, change, message
):
    path = tmp_path / "guess.txt"
    np.savetxt(path, np.load(scans / "truth.npy") @ change)
    done = scanlock("register", *pair, "--initial", path)
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
    assert str(path) in done.err
    assert message in done.err


def test_a_format_can_be_given_for_an_unknown_extension(scanlock, scans, tmp_path):
    odd = tmp_path / "scan.dat"
    odd.write_bytes((scans / "float32.bin").read_bytes())
    assert scanlock("register", odd, odd).code == 1
    done = scanlock("register", odd, odd, "--format", "bin", "--columns", "3", "--json")
    assert done.code == 0
    assert np.abs(np.array(json.loads(done.out)["target_from_source"]) - np.eye(4)).max() < 1e-6


def test_a_scan_is_never_overwritten_by_a_pose(scanlock, scans, pair):
    before = pair[1].read_bytes()
    done = scanlock("register", *pair, "-o", pair[1])
    assert done.code == 1
    assert "would be overwritten; use another name" in done.err
    assert pair[1].read_bytes() == before


def test_a_folder_that_cannot_be_created_is_an_error_of_one_line(scanlock, pair, tmp_path):
    (tmp_path / "file").touch()
    done = scanlock("register", *pair, "-o", tmp_path / "file" / "pose.txt")
    assert (done.code, done.out, done.err.count("\n")) == (1, "", 1)
