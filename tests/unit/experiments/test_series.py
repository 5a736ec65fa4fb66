from dataclasses import replace

import numba
import numpy as np
import pytest

from scanlock import Pose
from scanlock.errors import InvalidInput
from scanlock.experiments.series import ordinal_phrase, recorded_series, series_of, simulated_series
from scanlock.io import read_scan, write_kitti_poses, write_scan
from scanlock.io.sequences.scan_sequence import ScanSequence


def test_pairs_are_neighbours_with_their_true_motion(series):
    pairs = series.pairs()
    assert [(pair.target, pair.source) for pair in pairs] == [
        ("scan0", "scan1"),
        ("scan1", "scan2"),
        ("scan2", "scan3"),
    ]
    for row, pair in enumerate(pairs):
        moved = series.truth[row] @ pair.truth
        assert moved.is_close(series.truth[row + 1], translation=1e-12, rotation=1e-7)


def test_pairs_may_skip_scans(series):
    pairs = series.pairs(step=2)
    assert [pair.name for pair in pairs] == ["scan0 scan2", "scan1 scan3"]
    assert (series.truth[1] @ pairs[1].truth).is_close(
        series.truth[3], translation=1e-12, rotation=1e-7
    )
    with pytest.raises(InvalidInput, match="step must be below the 4 scans"):
        series.pairs(step=4)


def test_the_true_trajectory_begins_at_the_first_scan(series):
    shift = Pose(np.eye(3), np.array([5.0, 6.0, 7.0]))
    moved = replace(series, truth=tuple(shift @ pose for pose in series.truth))
    for pose, other in zip(moved.true_trajectory(), series.truth, strict=True):
        assert pose.is_close(other, translation=1e-12, rotation=1e-7)
    assert replace(series, truth=()).true_trajectory() == []
    assert [pair.truth for pair in replace(series, truth=()).pairs()] == [None] * 3


@pytest.mark.parametrize(
    "changes", [{"names": ("a",)}, {"times": np.arange(3.0)}, {"truth": (Pose.identity(),)}]
)
def test_a_series_needs_two_scans_and_lists_of_equal_length(series, changes):
    with pytest.raises(InvalidInput, match="scans"):
        replace(series, **changes)


@pytest.mark.slow
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="simulating takes minutes then")
def test_simulated_scans_equal_those_of_the_command(tmp_path):
    from scanlock.cli import main

    series = simulated_series("forest", "hdl_32e", every=20, scans=2, seed=3)
    command = series.origin.split()[1:]
    assert main([*command, "-o", str(tmp_path), "--format", "npy"]) == 0
    files = recorded_series(tmp_path, every=1)
    assert files.names == series.names
    for pose, other in zip(files.truth, series.truth, strict=True):
        assert pose.is_close(other, translation=1e-12, rotation=1e-7)
    np.testing.assert_array_equal(files.times, series.times)
    for name in series.names:
        points = read_scan(tmp_path / "scans" / f"{name}.npy").points
        np.testing.assert_array_equal(np.float32(points), series.load(name))
    # The key is independent of the number of scans, so a longer run can reuse the records.
    assert "scans" not in series.key


@pytest.fixture
def folder(tmp_path):
    for number in range(5):
        write_scan(tmp_path / f"{number}.npy", np.full((3, 3), float(number)))
    return tmp_path


def test_a_folder_gives_every_kth_scan(folder):
    series = recorded_series(folder, every=2)
    assert series.names == ("0", "2", "4")
    assert np.asarray(series.load("4"))[0, 0] == 4.0
    assert (series.truth, series.truth_kind) == ((), "unknown")
    assert recorded_series(folder, every=2, scans=2).names == ("0", "2")
    assert str(folder.parent) not in series.origin + series.title + series.key


def test_poses_of_a_file_follow_the_stride(folder, tmp_path_factory):
    path = tmp_path_factory.mktemp("poses") / "poses.txt"
    poses = [Pose(np.eye(3), np.array([float(k), 0.0, 0.0])) for k in range(5)]
    write_kitti_poses(path, poses)
    series = recorded_series(folder, every=2, poses=path)
    assert series.truth == tuple(poses[::2])
    assert series.truth_kind == "given"


def test_other_points_change_the_key(folder):
    before = recorded_series(folder, every=2).key
    write_scan(folder / "3.npy", np.zeros((3, 3)))
    assert recorded_series(folder, every=2).key == before
    write_scan(folder / "2.npy", np.zeros((3, 3)))
    assert recorded_series(folder, every=2).key != before


def test_files_with_equal_names_get_the_names_of_their_folders(tmp_path):
    paths = tuple(tmp_path / name / "scan.npy" for name in ("one", "two"))
    for number, path in enumerate(paths):
        path.parent.mkdir()
        write_scan(path, np.full((3, 3), float(number)))
    sequence = ScanSequence(
        title="files",
        paths=paths,
        times=np.arange(2.0),
        poses=(),
        load=lambda path: read_scan(path).points,
    )
    series = series_of(sequence, title="t", origin="o")
    assert series.names == ("one/scan", "two/scan")
    assert np.asarray(series.load("two/scan"))[0, 0] == 1.0
    other = series_of(sequence, title="t", origin="o", variant="4 columns")
    assert other.key != series.key


def test_too_few_scans_raise_an_error_with_a_remedy(folder):
    with pytest.raises(InvalidInput, match="reduce the stride"):
        recorded_series(folder, every=5)


@pytest.mark.parametrize(
    ("every", "words"),
    [
        (1, "every scan"),
        (2, "every 2nd scan"),
        (13, "every 13th scan"),
        (21, "every 21st scan"),
        (50, "every 50th scan"),
    ],
)
def test_ordinal_phrases_are_english(every, words):
    assert ordinal_phrase(every) == words
