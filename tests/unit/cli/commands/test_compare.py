import csv
import re
from dataclasses import replace

import pytest

from reference.studies import METHOD, toy_series
from scanlock.io import write_kitti_poses, write_pose, write_scan
from scanlock.registration.settings.file import read_settings, write_settings

_FAST = ["--methods", "sgc-ndt-d2d", "sgc-ndt-p2d", "--distances", "0", "1", "--angles", "0", "10"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four toy scans, their poses, and the pose of the first pair."""
    folder = tmp_path_factory.mktemp("toys")
    series = toy_series()
    (folder / "drive").mkdir()
    for name in series.names:
        write_scan(folder / "drive" / f"{name}.npy", series.load(name))
    write_kitti_poses(folder / "poses.txt", series.truth)
    write_pose(folder / "truth.txt", series.pairs()[0].truth)
    return folder


def _table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_two_files_are_compared_with_their_true_pose(scanlock, folder, tmp_path):
    files = [folder / "drive" / f"scan{number}.npy" for number in range(2)]
    done = scanlock("compare", *files, "--truth", folder / "truth.txt", *_FAST, "-o", tmp_path)
    assert (done.code, done.err) == (0, "")
    assert "2 scan files: 1 pair" in done.out
    rows = _table(tmp_path / "tables" / "basin.csv")
    assert len(rows) == 2 * 2 * 2
    assert {row["solved"] for row in rows} == {"1"}
    assert float(rows[-1]["initial rotation error [deg]"]) == 10.0
    assert re.search(r"method +all +0 m +1 m +0 deg +10 deg\n", done.out)
    assert re.search(r"sgc-ndt-p2d +4 / 4( +2 / 2){4}\n", done.out)
    assert "without reading and compiling" in done.out
    for name in ("errors.png", "basin.svg"):
        assert (tmp_path / "figures" / name).is_file()
    assert "scan0.npy scan1.npy" in (tmp_path / "index.md").read_text()


@pytest.mark.slow
def test_the_first_pairs_of_a_folder_are_compared_with_its_poses(scanlock, folder, tmp_path):
    done = scanlock(
        "compare", folder / "drive", "--poses", folder / "poses.txt", "--pairs", "2",
        "--starts", "0", "--methods", "sgc-ndt-d2d", "-o", tmp_path,
    )  # fmt: skip
    assert done.code == 0
    assert "every scan of drive (folder of scans): 2 pairs" in done.out
    rows = _table(tmp_path / "tables" / "pairs.csv")
    assert [(row["target"], row["source"]) for row in rows] == [
        ("scan0", "scan1"),
        ("scan1", "scan2"),
    ]
    assert all(float(row["translation error [m]"]) < 0.1 for row in rows)
    assert not (tmp_path / "tables" / "basin.csv").exists()


def test_the_step_between_the_scans_of_a_pair_can_be_set(scanlock, folder, tmp_path):
    scanlock("compare", folder / "drive", "--step", "3", *_FAST[:2], "-o", tmp_path)
    [row] = _table(tmp_path / "tables" / "pairs.csv")
    assert (row["target"], row["source"]) == ("scan0", "scan3")
    assert row["translation error [m]"] == ""


@pytest.mark.slow
def test_a_consensus_replaces_missing_poses(scanlock, folder, tmp_path):
    files = [folder / "drive" / f"scan{number}.npy" for number in range(2)]
    done = scanlock("compare", *files, "--agree", *_FAST, "-o", tmp_path)
    assert done.code == 0
    assert len(_table(tmp_path / "tables" / "basin.csv")) == 8
    assert "are a consensus of the methods" in (tmp_path / "index.md").read_text()
    assert "differences from the pose that most other methods agree on" in done.out
    errors = [float(row["median [m]"]) for row in _table(tmp_path / "tables" / "errors.csv")]
    # No method is compared with itself.
    assert errors[0] > 0.0
    assert errors[0] == pytest.approx(errors[1], rel=1e-9)


def test_agreement_has_no_starts_unless_they_are_asked_for(scanlock, folder, tmp_path):
    done = scanlock(
        "compare", folder / "drive", "--agree", "--pairs", "1", *_FAST[:3], "-o", tmp_path
    )
    assert done.code == 0
    assert not (tmp_path / "tables" / "basin.csv").exists()
    assert len(done.out.splitlines()) < 8


def test_the_page_of_another_comparison_is_not_replaced(scanlock, folder, tmp_path):
    arguments = ["compare", folder / "drive", "--pairs", "1", *_FAST[:3], "-o", tmp_path / "out"]
    first = scanlock(*arguments)
    page = (tmp_path / "out" / "index.md").read_bytes()
    records = (tmp_path / "out" / "records.jsonl").read_bytes()
    refused = scanlock(*arguments, "--agree")
    assert (refused.code, refused.out) == (1, "")
    assert "another comparison (agree was False, is True); use another folder" in refused.err
    assert (tmp_path / "out" / "index.md").read_bytes() == page
    # The same command prints the same again, with the times of the first run.
    assert scanlock(*arguments).out == first.out
    assert (tmp_path / "out" / "index.md").read_bytes() == page
    assert "-" not in first.out.splitlines()[2].split()[-1]
    assert scanlock(*arguments, "--agree", "--overwrite").code == 0
    assert (tmp_path / "out" / "index.md").read_bytes() != page
    assert (tmp_path / "out" / "records.jsonl").read_bytes() == records


def test_a_setting_is_changed_in_every_method(scanlock, folder, tmp_path):
    arguments = ["compare", folder / "drive", "--pairs", "1", "--methods", "icp", "gicp"]
    done = scanlock(*arguments, "--set", "voxel_size=0.8", "--threads", "2", "-o", tmp_path)
    assert (done.code, done.err) == (0, "")
    for name in ("icp", "gicp"):
        assert read_settings(tmp_path / "settings" / f"{name}.toml").voxel_size == 0.8
    done = scanlock(*arguments, "--set", "search.voxel_sizes=[1]", "-o", tmp_path / "out")
    assert "--set for icp: search" in done.err
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_results_are_reproducible_and_read_from_disk_if_present(scanlock, folder, tmp_path):
    arguments = [
        "compare",
        folder / "drive",
        "--poses",
        folder / "poses.txt",
        *_FAST,
        "--pairs",
        "1",
    ]
    for name in ("one", "two", "one"):
        done = scanlock(*arguments, "-o", tmp_path / name)
    # The third run reads all records and their times from disk.
    assert re.search(r"sgc-ndt-d2d .* \d+\n", done.out)
    files = [
        {
            path.relative_to(tmp_path / name): path.read_bytes()
            for path in found
            if path.is_file() and path.name != "times.jsonl"
        }
        for name in ("one", "two")
        for found in [sorted((tmp_path / name).rglob("*"))]
    ]
    assert files[0] == files[1]
    assert not any(str(tmp_path).encode() in content for content in files[0].values())


def test_a_settings_file_is_an_additional_method(scanlock, folder, tmp_path):
    write_settings(tmp_path / "mine.toml", replace(METHOD, voxel_size=0.7))
    done = scanlock(
        "compare", folder / "drive", "--pairs", "1", "--methods", "sgc-ndt-d2d",
        "--settings", tmp_path / "mine.toml", "-o", tmp_path / "out",
    )  # fmt: skip
    assert done.code == 0
    rows = _table(tmp_path / "out" / "tables" / "pairs.csv")
    assert [row["method"] for row in rows] == ["sgc-ndt-d2d", "mine"]
    assert read_settings(tmp_path / "out" / "settings" / "mine.toml").voxel_size == 0.7
    (tmp_path / "mine.toml").rename(tmp_path / "sgc-ndt-d2d.toml")
    done = scanlock("compare", folder / "drive", "--settings", tmp_path / "sgc-ndt-d2d.toml")
    assert done.code == 1
    assert "two methods have the name sgc-ndt-d2d" in done.err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["drive/scan0.npy"], "two scan files or more, or one folder"),
        ([], "two scan files or more, or one folder"),
        (["drive", "--starts", "2"], "--starts needs true poses"),
        (["drive", "--truth", "truth.txt"], "--truth is the pose of one pair"),
        (["drive/scan0.npy", "drive/scan1.npy", "--poses", "poses.txt"], "one for each of 2 scans"),
        (["drive", "--methods", "magic"], "magic"),
        (["drive", "--step", "0"], "--step must be a whole number"),
        (["drive", "--metres", "0"], "metres must be positive"),
        (["drive", "--agree", "--distances", "2", "1"], "distances must be strictly ascending"),
    ],
)
def test_invalid_arguments_are_refused_before_the_work(
    scanlock, folder, tmp_path, monkeypatch, arguments, message
):
    monkeypatch.chdir(folder)
    done = scanlock("compare", *arguments, "-o", tmp_path / "out")
    assert (done.code, done.out) == (1, "")
    assert message in done.err
    assert not (tmp_path / "out").exists()
