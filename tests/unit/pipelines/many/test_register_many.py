import itertools
import os

import numpy as np
import pytest

import scanlock
from reference.pair_readers import read_or_die
from reference.samples import street, yaw_pose
from scanlock import InvalidInput, Pair, register_many
from scanlock.io import write_pose, write_scan

MOTION = yaw_pose(0.15, (1.2, -0.6, 0.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Four scans of one scene, a killer, and files that cannot be read."""
    folder = tmp_path_factory.mktemp("pairs")
    for k in range(4):
        pose = yaw_pose(0.05 * k, (0.4 * k, 0.0, 0.0))
        write_scan(folder / f"{k}.npy", pose.inverse().apply(street(k + 1, 3000)))
    write_scan(folder / "killer.npy", street(1, 3000))
    (folder / "cut.bin").write_bytes(b"1234567")
    np.save(folder / "empty.npy", np.full((5, 3), np.nan))
    write_pose(folder / "guess.txt", yaw_pose(0.05, (0.4, 0.0, 0.0)))
    return folder


def _list(folder):
    pairs = [(folder / f"{a}.npy", folder / f"{b}.npy") for a in range(4) for b in range(a)]
    pairs[2:2] = [
        (folder / "cut.bin", folder / "0.npy"),
        (folder / "0.npy", folder / "missing.npy"),
        (folder / "empty.npy", folder / "0.npy"),
        (np.zeros((3, 2)), folder / "0.npy"),
    ]
    return pairs


def test_a_row_has_the_numbers_of_the_result(folder):
    path = folder / "1.npy", folder / "0.npy"
    [row] = register_many([path], executor=None, covariance="sandwich")
    source, target = (np.load(one) for one in path)
    result = scanlock.register(source=source, target=target, covariance="sandwich")
    assert result.covariance is not None
    assert (row.status, row.reason, row.method) == (result.status.value, result.reason, "auto")
    assert (row.name, row.source, row.target) == ("1 0", *map(str, path))
    np.testing.assert_allclose(row.target_from_source, result.transformation, atol=1e-14)
    np.testing.assert_allclose(row.pose[:3], result.transformation[:3, 3], rtol=0, atol=0)
    assert row.probability == result.probability
    assert row.overlap == result.overlap
    accuracy = result.accuracy
    assert row.deviations == (*accuracy.translation, *accuracy.rotation)
    assert row.translation == pytest.approx(np.linalg.norm(result.transformation[:3, 3]))
    assert row.ok == result.ok
    assert row.seconds > 0.0


def test_failures_are_rows_and_the_others_are_kept(folder):
    rows = list(register_many(_list(folder), executor=None))
    errors = {k: row for k, row in enumerate(rows) if row.status == "error"}
    assert {k: row.error for k, row in errors.items()} == {
        2: "FormatError",
        3: "FileNotFoundError",
        4: "FormatError",
        5: "InvalidInput",
    }
    assert "missing.npy: no such file or directory" in errors[3].reason
    assert "none of its 5 points is finite" in errors[4].reason
    assert errors[2].pose is errors[2].target_from_source is errors[2].probability is None
    assert len(rows) == 10
    assert all(row.pose for k, row in enumerate(rows) if k not in errors)


def test_threads_give_the_rows_of_one_thread(folder):
    one = list(register_many(_list(folder), executor=None))
    for workers in (1, 3):
        assert list(register_many(_list(folder), executor="threads", workers=workers)) == one


@pytest.mark.slow
def test_processes_give_the_rows_of_one_thread(folder):
    one = list(register_many(_list(folder), executor=None))
    assert list(register_many(_list(folder), executor="processes", workers=2)) == one


@pytest.mark.stress
def test_a_pair_that_ends_its_process_is_a_row_and_the_others_are_kept(folder):
    pairs = _list(folder)[-4:]
    pairs[2:2] = [(folder / "killer.npy", folder / "0.npy")]
    rows = list(register_many(pairs, executor="processes", workers=2, read=read_or_die))
    assert [row.error for row in rows] == ["", "", "WorkerDied", "", ""]
    assert "the worker process died" in rows[2].reason
    assert [row.name for row in rows if row.ok] == [row.name for row in rows if not row.error]


def test_a_scan_of_several_pairs_is_read_once(folder):
    read = []

    def reader(path):
        read.append(path.name)
        return np.load(path)

    pairs = [(folder / f"{a}.npy", folder / f"{b}.npy") for a in range(4) for b in range(a)]
    rows = list(register_many(pairs, executor="threads", workers=2, read=reader))
    assert len(rows) == 6
    assert sorted(read) == ["0.npy", "1.npy", "2.npy", "3.npy"]
    read.clear()
    list(register_many(pairs, executor=None, read=reader, cache_bytes=0))
    assert len(read) == 12


def test_a_list_without_end_yields_rows(folder):
    taken = itertools.count()
    path = folder / "1.npy", folder / "0.npy"
    endless = (path for _ in iter(lambda: next(taken), None))
    rows = register_many(endless, executor="threads", workers=2)
    assert [row.name for row in itertools.islice(rows, 5)] == ["1 0"] * 5
    rows.close()
    assert next(taken) < 200


def test_an_initial_pose_may_be_a_file_or_a_pose(folder):
    scans = {"source": folder / "1.npy", "target": folder / "0.npy"}
    guess = yaw_pose(0.05, (0.4, 0.0, 0.0))
    pairs = [
        Pair(**scans, initial=folder / "guess.txt", extra={"place": "hall"}),
        Pair(**scans, initial=guess.matrix),
        Pair(**scans, initial=guess),
        Pair(**scans, initial=folder / "0.npy"),
    ]
    first, second, third, wrong = register_many(pairs, method="gicp", executor=None)
    assert first.as_dict().pop("place") == "hall"
    np.testing.assert_allclose(first.pose, second.pose, atol=1e-9)
    assert second.pose == third.pose
    assert wrong.status == "error"


def test_rows_become_a_table(folder):
    pairs = [(folder / "1.npy", folder / "0.npy"), (folder / "cut.bin", folder / "0.npy")]
    good, bad = register_many(pairs, executor=None).to_dicts()
    assert list(good) == list(bad)
    assert isinstance(good["x"], float)
    assert (good["ok"], bad["ok"], bad["x"]) == (True, False, None)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "nothing"}, "method"),
        ({"dof": "nothing"}, "dof"),
        ({"covariance": "nothing"}, "covariance|method"),
        ({"executor": "nothing"}, "executor must be 'threads', 'processes', None or the address"),
        ({"workers": 0}, "workers must be a whole number of at least 1"),
        ({"cache_bytes": -1}, "cache_bytes"),
        ({"executor": "tcp://nowhere:1", "workers": 2}, "workers must be None for a cluster"),
    ],
)
def test_a_wrong_option_is_refused_before_the_first_pair(options, message):
    with pytest.raises(InvalidInput, match=message):
        register_many([], **options)


def test_workers_see_one_thread_for_linear_algebra(monkeypatch):
    from scanlock.pipelines.many.workers import _one_thread_each

    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("MKL_NUM_THREADS", raising=False)
    with _one_thread_each():
        assert os.environ["OMP_NUM_THREADS"] == os.environ["MKL_NUM_THREADS"] == "1"
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "MKL_NUM_THREADS" not in os.environ
