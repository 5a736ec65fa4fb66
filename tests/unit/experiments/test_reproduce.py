import csv
import json
import re
from dataclasses import replace

import numpy as np
import pytest

from reference.studies import METHOD, contender
from scanlock.experiments import claims
from scanlock.experiments.experiment import Findings, Progress, Section
from scanlock.experiments.page import file_name
from scanlock.experiments.paper_methods import D2D, G_ICP, P2D
from scanlock.experiments.reproduce import EXPERIMENTS, reproduce
from scanlock.io import read_kitti_poses, read_scan, read_tum_poses
from scanlock.pipelines import study as study_module
from scanlock.pipelines.study_records import TIMES
from scanlock.registration.settings.file import read_settings

pytestmark = pytest.mark.slow

NAMES = (P2D, D2D, G_ICP)


@pytest.fixture(scope="module", params=["urban", "forest"])
def experiment(request):
    contenders = [
        contender(name, replace(METHOD, voxel_size=0.5 + k)) for k, name in enumerate(NAMES)
    ]
    return replace(EXPERIMENTS[request.param], contenders=contenders)


@pytest.fixture(scope="module", autouse=True)
def any_number_of_pairs():
    """Claims on three pairs."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(claims, "MIN_PAIRS", 3)
        yield


@pytest.fixture(scope="module")
def seen():
    """Calls of the progress of `done`: task, announced and actual number of items."""
    return []


@pytest.fixture(scope="module")
def done(experiment, series, seen, tmp_path_factory):
    def progress(items, count, task):
        items = list(items)
        seen.append((task, count, len(items)))
        return items

    checked: Progress = progress
    folder = tmp_path_factory.mktemp("here") / "out"
    seen.clear()
    return reproduce(experiment, series, folder, checked)


def _files(folder):
    """Content of every file but that of the wall times."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != TIMES
    }


def test_the_same_experiment_gives_the_same_bytes(experiment, series, done, tmp_path):
    reproduce(experiment, series, tmp_path)
    assert _files(tmp_path) == _files(done.page.parent)


def test_files_contain_no_path_and_no_time(done):
    for name, content in _files(done.page.parent).items():
        assert str(done.page.parent).encode() not in content, name
        assert b"seconds" not in content, name


def test_every_file_on_the_page_exists(done):
    page = done.page.read_text()
    for link in re.findall(r"\]\(([^)]+)\)", page):
        assert (done.page.parent / link).is_file(), link
    assert re.search("(holds here|not hold here).*: (filled voxels|median|solved)", page)
    assert ("cannot be decided here" in page) == ("was not run" in page)
    for name in ("pairs", "errors", "crispness"):
        assert (done.page.parent / "tables" / f"{name}.csv").is_file()
    for ending in ("png", "svg"):
        assert (done.page.parent / "figures" / f"maps.{ending}").is_file()


def test_settings_can_be_read_back(experiment, done):
    for one in experiment.contenders:
        path = done.page.parent / "settings" / f"{file_name(one.name)}.toml"
        assert read_settings(path) == one.method


def test_tables_agree_with_the_records(done, series):
    folder = done.page.parent
    with (folder / "tables" / "pairs.csv").open() as file:
        rows = list(csv.DictReader(file))
    records = [json.loads(line) for line in (folder / "records.jsonl").read_text().splitlines()]
    assert len(rows) == len(records) == len(NAMES) * len(series.pairs())
    errors = {(r["method"], r["pair"]): r["translation_error_m"] for r in records}
    for row in rows:
        key = (row["method"], f"{row['target']} {row['source']}")
        assert float(row["translation error [m]"]) == errors[key]


def test_trajectories_and_maps_agree_with_the_records(done, series):
    folder = done.page.parent
    poses = read_kitti_poses(folder / "trajectories" / "sgc-ndt-d2d.kitti.txt")
    times, same = read_tum_poses(folder / "trajectories" / "sgc-ndt-d2d.tum.txt")
    np.testing.assert_array_equal(times, series.times)
    chain = poses[0]
    for record, pose, other in zip(done.outcome.records[D2D], poses[1:], same[1:], strict=True):
        chain = chain @ record.pose
        assert pose.is_close(chain, translation=1e-12, rotation=1e-7)
        assert other.is_close(chain, translation=1e-12, rotation=1e-7)
    with (folder / "tables" / "crispness.csv").open() as file:
        counts = {row["method"]: int(row["voxels"]) for row in csv.DictReader(file)}
    for name, count in counts.items():
        stem = {"true poses": "true-poses", D2D: "sgc-ndt-d2d"}.get(name)
        if stem is not None:
            assert len(read_scan(folder / "maps" / f"{stem}.ply")) == count


def test_an_interrupted_run_continues(experiment, series, done, tmp_path, monkeypatch):
    real = study_module.register
    calls = []

    def register(**keywords):
        calls.append(None)
        if len(calls) == len(NAMES) + 5:
            raise KeyboardInterrupt
        return real(**keywords)

    monkeypatch.setattr(study_module, "register", register)
    with pytest.raises(KeyboardInterrupt):
        reproduce(experiment, series, tmp_path)
    assert len((tmp_path / "records.jsonl").read_text().splitlines()) == 4
    reproduce(experiment, series, tmp_path)
    # The fifth registration started twice, the others once, and each method loaded its kernels in
    # both runs.
    assert len(calls) == len(NAMES) * len(series.pairs()) + 1 + 2 * len(NAMES)
    assert _files(tmp_path) == _files(done.page.parent)


def test_progress_covers_every_registration_and_every_scan(done, seen):
    assert done.page.is_file()
    assert [(count, found) for _, count, found in seen] == [(9, 9), (4, 4)]


def test_an_experiment_may_choose_its_pairs(experiment, series, tmp_path):
    skipping = replace(
        experiment,
        pairs=lambda series: series.pairs(step=3),
        analyse=lambda outcome, progress: Findings(sections=[Section(title="Nothing")]),
    )
    done = reproduce(skipping, series, tmp_path)
    for records in done.outcome.records.values():
        assert [record.task.pair for record in records] == ["scan0 scan3"]
    assert "## Nothing" in done.page.read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "index.md",
        "records.jsonl",
        "settings",
        "times.jsonl",
    ]


def test_the_page_does_not_need_true_poses(experiment, series, tmp_path):
    blind = replace(series, truth=(), truth_kind="unknown")
    page = reproduce(experiment, blind, tmp_path).page.read_text()
    assert "The true poses are not known." in page
    assert "the true poses are not known" in page
    assert not (tmp_path / "maps" / "true-poses.ply").exists()


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_contenders_have_unique_names_and_remarks(name):
    contenders = EXPERIMENTS[name].contenders
    assert len({one.name for one in contenders}) == len(contenders)
    assert D2D in {one.name for one in contenders}
    assert all(one.remark for one in contenders)
