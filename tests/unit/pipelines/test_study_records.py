import json
import math
import os
from dataclasses import replace

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock import METHODS, Pose, SgcNdt
from scanlock.errors import FormatError
from scanlock.pipelines import study as study_module
from scanlock.pipelines.starts import AroundTruth
from scanlock.pipelines.study import FAILED, Study, StudyPair
from scanlock.pipelines.study_records import read_records, record_keys, stored_records

STEP = yaw_pose(0.1, (1.0 / 3.0, 0.4, 0.0))
METHOD = METHODS["sgc-ndt-d2d"]


@pytest.fixture(scope="module")
def study():
    """Two pairs, the second with a scan without finite points."""
    scans = {
        "a": street(1),
        "b": STEP.inverse().apply(street(2)),
        "c": np.full((9, 3), np.nan),
    }
    pairs = [StudyPair(target="a", source=name, truth=STEP) for name in ("b", "c")]
    return Study(methods={"d2d": METHOD}, pairs=pairs, load=scans.__getitem__)


@pytest.fixture
def counted(monkeypatch):
    """List with one item: the number of registrations."""
    done = [0]
    real = study_module.register

    def register(**keywords):
        done[0] += 1
        return real(**keywords)

    monkeypatch.setattr(study_module, "register", register)
    return done


def test_records_round_trip_with_every_digit(study, tmp_path):
    path = tmp_path / "records.jsonl"
    new = list(stored_records(path, study, "here"))
    assert [record.status for record in new] == ["ok", FAILED]
    read = read_records(path)
    assert list(read) == list(record_keys(study, "here").values())
    for record, other in zip(new, read.values(), strict=True):
        assert other == record
        assert math.isnan(other.seconds)
    assert math.isfinite(new[0].seconds)
    assert new[0].pose.matrix.tobytes() == next(iter(read.values())).pose.matrix.tobytes()


def test_lines_are_json_with_units_and_without_run_times(study, tmp_path):
    path = tmp_path / "records.jsonl"
    list(stored_records(path, study, "here"))
    good, bad = (json.loads(line) for line in path.read_text().splitlines())
    assert not any("second" in key or "time" in key for key in good)
    assert (good["pair"], good["method"], good["start"]) == ("a b", "d2d", "identity")
    assert good["translation_error_m"] < 0.1
    assert (bad["pose"], bad["overlap"]) == (None, None)
    assert "scan c" in bad["reason"]


def test_a_second_run_registers_nothing_and_keeps_records_and_times(study, tmp_path, counted):
    path = tmp_path / "records.jsonl"
    first = list(stored_records(path, study, "here"))
    before = path.read_bytes()
    # Once to load the kernels, and once for the record.
    assert counted == [2]
    again = list(stored_records(path, study, "here"))
    assert again == first
    assert [record.seconds for record in again][:1] == [record.seconds for record in first][:1]
    assert counted == [2]
    assert path.read_bytes() == before


def test_an_incomplete_or_missing_file_of_times_leaves_the_records(study, tmp_path):
    path, times = tmp_path / "records.jsonl", tmp_path / "times.jsonl"
    first = list(stored_records(path, study, "here"))
    line = times.read_bytes()
    assert json.loads(line)["seconds"] == first[0].seconds > 0.0
    for rest in (line[:-9], b"null\n"):
        times.write_bytes(rest)
        again = list(stored_records(path, study, "here"))
        assert again == first
        assert math.isnan(again[0].seconds)
    times.unlink()
    assert list(stored_records(path, study, "here")) == first


def test_a_resumed_run_writes_the_same_bytes(study, tmp_path, counted):
    whole, broken = tmp_path / "whole.jsonl", tmp_path / "broken.jsonl"
    list(stored_records(whole, study, "here"))
    records = stored_records(broken, study, "here")
    next(records)
    # A yielded record is on disk before the file is closed.
    assert len(read_records(broken)) == 1
    records.close()
    assert counted == [4]
    list(stored_records(broken, study, "here"))
    assert counted == [4]
    assert broken.read_bytes() == whole.read_bytes()


@pytest.mark.slow
@pytest.mark.parametrize("kept", [1, 5, 40, -1])
@pytest.mark.parametrize("padding", [b"", b"\0\0\0"])
def test_the_task_of_an_incomplete_line_is_registered_again(study, tmp_path, kept, padding):
    path = tmp_path / "records.jsonl"
    list(stored_records(path, study, "here"))
    before = path.read_bytes()
    first = before.index(b"\n") + 1
    path.write_bytes(before[:first] + before[first:][:kept] + padding)
    assert len(read_records(path)) == 1
    list(stored_records(path, study, "here"))
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "change",
    [
        {"methods": {"d2d": replace(METHOD, voxel_size=0.7)}},
        {"methods": {"d2d": SgcNdt(score="p2d")}},
        {"methods": {"other": METHOD}},
        {"pairs": [StudyPair(target="a", source="b", truth=Pose.identity())]},
        {"starts": AroundTruth(distances=(1.0,), angles=(0.0,))},
    ],
)
def test_changed_studies_do_not_reuse_old_records(study, change):
    old = set(record_keys(study, "here").values())
    assert not old & set(record_keys(replace(study, **change), "here").values())


def test_scans_from_another_origin_do_not_reuse_old_records(study):
    keys = [set(record_keys(study, where).values()) for where in ("here", "there")]
    assert not keys[0] & keys[1]


def test_added_methods_and_starts_keep_old_records_valid(study):
    few = AroundTruth(distances=(1.0,), angles=(0.0,))
    many = AroundTruth(distances=(1.0, 2.0), angles=(0.0, 0.1), repeats=2)
    old = record_keys(replace(study, starts=few), "here")
    more = {"d2d": METHOD, "p2d": METHODS["sgc-ndt-p2d"]}
    new = record_keys(replace(study, methods=more, starts=many), "here")
    assert old.items() <= new.items()
    other = record_keys(replace(study, starts=replace(few, seed=1)), "here")
    assert not set(old.values()) & set(other.values())


@pytest.mark.parametrize(
    ("text", "where"),
    [
        (b"name,error\n1,2\n", "line 1"),
        (b"no line end", "line 1"),
        (b'{"key": "1"}\n', "line 1"),
        (b'{"key": "1", "pose": [[1]]}\n', "line 1"),
    ],
)
def test_files_that_are_no_records_are_refused_and_unchanged(study, tmp_path, text, where):
    path = tmp_path / "table.csv"
    path.write_bytes(text)
    with pytest.raises(FormatError, match=f"{where}: expected a record"):
        list(stored_records(path, study, "here"))
    assert path.read_bytes() == text


def test_a_record_is_synced_before_it_is_yielded(study, tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda number: synced.append(os.fstat(number).st_size))
    path = tmp_path / "records.jsonl"
    records = stored_records(path, study, "here")
    next(records)
    assert synced == [path.stat().st_size]
    records.close()
