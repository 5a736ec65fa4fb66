import re
from dataclasses import replace
from typing import get_args

import pytest

from reference.studies import METHOD, contender, toy_series
from scanlock.cli.commands import reproduce as command
from scanlock.experiments import claims
from scanlock.experiments import reproduce as module
from scanlock.experiments.paper_methods import D2D, P2D
from scanlock.io import write_kitti_poses, write_scan


@pytest.fixture
def toys(monkeypatch):
    """Experiments with two methods, on four toy scans instead of simulated ones."""
    calls = []

    def simulated(scans, seed):
        calls.append((scans, seed))
        return toy_series()

    toys = {
        name: replace(
            experiment,
            contenders=[contender(P2D), contender(D2D, replace(METHOD, voxel_size=0.6))],
            simulate=simulated,
        )
        for name, experiment in module.EXPERIMENTS.items()
    }
    monkeypatch.setattr(module, "EXPERIMENTS", toys)
    monkeypatch.setattr(claims, "MIN_PAIRS", 3)
    return calls


def test_names_equal_those_of_the_experiments():
    assert get_args(command.ExperimentName) == tuple(module.EXPERIMENTS)


@pytest.mark.slow
def test_the_page_is_written_and_the_results_are_printed(scanlock, toys, tmp_path):
    done = scanlock("reproduce", "forest", "-o", tmp_path, "--scans", "4", "--seed", "7")
    assert (done.code, done.err) == (0, "")
    assert toys == [(4, 7)]
    assert f"wrote {tmp_path / 'index.md'}" in done.out
    [row] = [line.split() for line in done.out.splitlines() if line.strip().startswith(D2D)]
    assert row[1:7] == ["3", "/", "3"] * 2
    assert float(row[7]) < 0.1
    assert float(row[-1]) > 0.0
    assert re.search(r"holds +SGC-NDT gives good registrations", done.out)
    assert re.search(r"undecided +The maps of both", done.out)


@pytest.mark.slow
def test_a_second_run_reads_records_and_times(scanlock, toys, tmp_path):
    first = scanlock("reproduce", "urban", "-o", tmp_path)
    page = (tmp_path / "index.md").read_bytes()
    done = scanlock("reproduce", "urban", "-o", tmp_path)
    assert done.out == first.out
    [row] = [line.split() for line in done.out.splitlines() if line.strip().startswith(D2D)]
    assert float(row[-1]) > 0.0
    assert (tmp_path / "index.md").read_bytes() == page


@pytest.mark.slow
def test_the_page_of_another_run_is_kept_unless_it_may_be_replaced(scanlock, toys, tmp_path):
    out = tmp_path / "out"
    assert scanlock("reproduce", "urban", "-o", out).code == 0
    page = (out / "index.md").read_bytes()
    done = scanlock("reproduce", "forest", "-o", out)
    assert (done.code, done.out) == (1, "")
    assert "contains another reproduction (experiment was urban, is forest)" in done.err
    assert (out / "index.md").read_bytes() == page
    (out / "options.json").unlink()
    assert "options are not known" in scanlock("reproduce", "urban", "-o", out).err
    assert scanlock("reproduce", "forest", "-o", out, "--overwrite").code == 0
    assert (out / "index.md").read_bytes() != page
    done = scanlock("reproduce", "urban", "-o", tmp_path / "typo" / "out")
    assert done.code == 1
    assert not (tmp_path / "typo").exists()


@pytest.mark.slow
def test_claims_on_a_few_pairs_are_not_judged(scanlock, toys, tmp_path, monkeypatch):
    monkeypatch.setattr(claims, "MIN_PAIRS", 10)
    done = scanlock("reproduce", "urban", "-o", tmp_path)
    assert "too few pairs to judge: 3, at least 10 needed" in " ".join(done.out.split())
    assert "does not hold" not in done.out


@pytest.mark.slow
def test_the_folder_is_named_after_the_experiment(scanlock, toys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert scanlock("reproduce", "forest").code == 0
    assert (tmp_path / "scanlock-forest" / "index.md").is_file()
    assert toys == [(module.EXPERIMENTS["forest"].scans, 1)]


@pytest.mark.slow
def test_recorded_scans_have_the_interval_of_the_paper(scanlock, toys, tmp_path):
    series = toy_series()
    data = tmp_path / "data"
    data.mkdir()
    every = module.EXPERIMENTS["urban"].every
    # Only every tenth scan is used, so the others can be copies.
    for number in range(2 * every + 1):
        write_scan(data / f"{number:03d}.npy", series.load(series.names[number // every]))
    write_kitti_poses(
        tmp_path / "poses.txt", [series.truth[k // every] for k in range(2 * every + 1)]
    )
    done = scanlock(
        "reproduce", "urban", "--data", data, "--poses", tmp_path / "poses.txt",
        "-o", tmp_path / "out",
    )  # fmt: skip
    assert (done.code, toys) == (0, [])
    assert "3 scans, every 10th scan of data (folder of scans)" in done.out
    page = (tmp_path / "out" / "index.md").read_text()
    assert "The poses of the data set count as true" in page
    assert str(tmp_path) not in page


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["urban", "--scans", "1"], "--scans must be a whole number of at least 2"),
        (["urban", "--seed", "-1"], "--seed must be a whole number"),
        (["urban", "--poses", "poses.txt"], "--poses needs --data"),
        (["urban", "--data", "nowhere"], "no such folder of scans"),
        (["ladar", "--data", "nowhere"], "ladar needs range images, which are simulated"),
        (["moon"], "urban"),
    ],
)
def test_invalid_arguments_are_refused_before_the_work(
    scanlock, toys, tmp_path, arguments, message
):
    done = scanlock("reproduce", *arguments, "-o", tmp_path / "out")
    assert (done.code, done.out) == (1, "")
    assert message in done.err
    assert not (tmp_path / "out").exists()
