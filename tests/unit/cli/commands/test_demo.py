import sys
from dataclasses import replace

import numba
import numpy as np
import pytest

from scanlock.io import read_pose, read_scan
from scanlock.simulation import hdl_64e, scan_pair

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        numba.config.DISABLE_JIT, reason="simulating without a compiler takes minutes"
    ),
]


@pytest.fixture(scope="module")
def pair():
    return scan_pair("street", replace(hdl_64e(), azimuth_steps=500), 3, baseline=(4.0, 6.0))


@pytest.fixture
def small_scans(monkeypatch, pair):
    monkeypatch.setattr("scanlock.simulation.scan_pair", lambda *_, **__: pair)


def test_all_files_but_the_picture_are_written_without_matplotlib(
    scanlock, small_scans, monkeypatch, pair, tmp_path
):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    done = scanlock("demo", "-o", tmp_path / "new")
    assert (done.code, done.err) == (0, "")
    assert 'pip install "scanlock[figures]"' in done.out
    names = ["exact_pose.txt", "pose.txt", "source.ply", "target.ply"]
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == names
    exact = np.loadtxt(tmp_path / "new" / "exact_pose.txt")
    np.testing.assert_array_equal(exact, pair.target_from_source.matrix)
    np.testing.assert_array_equal(
        read_scan(tmp_path / "new" / "source.ply").points, pair.source.points
    )


def test_the_result_is_printed_with_the_truth_and_the_error(scanlock, small_scans, pair, tmp_path):
    done = scanlock("demo", "-o", tmp_path)
    assert done.code == 0
    lines = [line.split() for line in done.out.splitlines()]
    [error] = [line for line in lines if line[:1] == ["error"]]
    metres, radians = read_pose(tmp_path / "pose.txt").distance(pair.target_from_source)
    assert float(error[1]) == pytest.approx(100.0 * metres, abs=0.005)
    assert float(error[4]) == pytest.approx(np.degrees(radians), abs=0.0005)
    assert done.out.splitlines()[0] == "ok  source onto target"
    assert (tmp_path / "picture.png").read_bytes().startswith(b"\x89PNG")
    assert lines[-1][-4:] == [
        "scanlock",
        "register",
        str(tmp_path / "source.ply"),
        str(tmp_path / "target.ply"),
    ]
