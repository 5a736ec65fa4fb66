import math
from dataclasses import replace

import numpy as np
import pytest

from reference.studies import METHOD, STEP
from scanlock import METHODS
from scanlock.experiments.comparison import (
    Comparison,
    basin_table,
    basins,
    compare,
    comparison_findings,
)
from scanlock.pipelines.starts import AroundTruth

PLAN = AroundTruth(distances=(0.0, 1.0), angles=(0.0, 0.2), repeats=2)
TWO = {"d2d": METHOD, "p2d": METHODS["sgc-ndt-p2d"]}


def _comparison(series, **changes):
    defaults = {
        "methods": {"d2d": METHOD},
        "pairs": series.pairs()[:2],
        "load": series.load,
        "key": series.key,
        "around": PLAN,
    }
    return Comparison(**(defaults | changes))


@pytest.fixture(scope="module")
def compared(series, tmp_path_factory):
    path = tmp_path_factory.mktemp("compare") / "records.jsonl"
    return compare(_comparison(series), path)


@pytest.mark.slow
def test_starts_around_the_truth_follow_those_from_the_identity(compared):
    assert [record.task.start for record in compared.direct["d2d"]] == ["identity"] * 2
    assert [record.task.start for record in compared.around["d2d"]] == [*PLAN.names] * 2
    assert (compared.evaluated_count, compared.consensus_count) == (2, 0)


def test_the_basin_counts_every_start_once(compared):
    [basin] = basins(compared, PLAN).values()
    assert basin.tried.tolist() == [[4, 4], [4, 4]]
    assert basin.solved.tolist() == [[4, 4], [4, 4]]
    lost = [
        replace(record, translation_error=1.0)
        if PLAN.levels[record.task.start] == (1.0, 0.2)
        else record
        for record in compared.around["d2d"]
    ]
    lossy = replace(compared, around={"d2d": lost})
    assert basins(lossy, PLAN)["d2d"].solved.tolist() == [[4, 4], [4, 0]]
    rows = basin_table(lossy, PLAN).rows
    degrees = round(math.degrees(0.2), 9)
    assert rows[0] == ["d2d", 0.0, 0.0, 4, 4, 4, 0]
    assert rows[-1] == ["d2d", 1.0, degrees, 4, 0, 4, 4]


@pytest.mark.slow
def test_a_second_run_reads_all_records_from_disk(series, tmp_path):
    path = tmp_path / "records.jsonl"

    def refuse(name):
        raise AssertionError(name)

    first = compare(_comparison(series), path)
    before = path.read_bytes()
    again = compare(_comparison(series, load=refuse), path)
    assert again.direct == first.direct
    assert again.around == first.around
    assert path.read_bytes() == before


def test_pairs_without_a_truth_are_not_evaluated(series, tmp_path):
    blind = [replace(pair, truth=None) for pair in series.pairs()[:1]]
    comparison = _comparison(series, pairs=blind)
    compared = compare(comparison, tmp_path / "records.jsonl")
    assert (compared.evaluated_count, compared.around) == (0, {})
    [section] = comparison_findings(comparison, compared, series).sections
    assert "no errors to show" in section.text
    assert section.figures == {}


@pytest.mark.slow
def test_a_consensus_replaces_an_unknown_truth_on_request(series, tmp_path):
    blind = [replace(pair, truth=None) for pair in series.pairs()[:1]]
    plan = AroundTruth(distances=(0.5,), angles=(0.1,))
    comparison = _comparison(series, pairs=blind, methods=TWO, around=plan, use_consensus=True)
    compared = compare(comparison, tmp_path / "records.jsonl")
    assert (compared.evaluated_count, compared.consensus_count) == (1, 1)
    [pair] = compared.pairs
    errors = [records[0].translation_error for records in compared.direct.values()]
    # Neither is compared with its own pose, so both have the difference of the two as error.
    assert 0.0 < min(errors) < 0.1
    assert min(errors) == pytest.approx(max(errors), rel=1e-9)
    around = compared.around["d2d"][0], compared.around["p2d"][0]
    assert all(0.0 < record.translation_error < 0.1 for record in around)
    assert pair.truth.is_close(STEP, translation=0.1, rotation=0.01)
    assert len(compared.around["p2d"]) == 1
    sections = comparison_findings(comparison, compared, series).sections
    assert "1 of these are a consensus of the methods" in sections[0].text
    assert list(sections[1].figures) == ["basin"]


def test_a_consensus_does_not_replace_a_known_truth(series, tmp_path):
    comparison = _comparison(series, methods=TWO, around=None, use_consensus=True)
    compared = compare(comparison, tmp_path / "records.jsonl")
    assert compared.consensus_count == 0
    assert [pair.truth for pair in compared.pairs] == [pair.truth for pair in comparison.pairs]


def test_findings_have_tables_and_figures_of_both_sections(compared, series):
    sections = comparison_findings(_comparison(series), compared, series).sections
    assert [list(section.tables) for section in sections] == [["errors", "pairs"], ["basin"]]
    assert [list(section.figures) for section in sections] == [["errors"], ["basin"]]
    [row] = sections[0].tables["errors"].rows
    assert row[:3] == ["d2d", 2, 2]
    assert np.isfinite(row[3:11]).all()
