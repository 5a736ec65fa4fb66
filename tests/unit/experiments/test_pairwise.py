import math
from dataclasses import replace

import numpy as np
import pytest

from reference.studies import STEP, record_of
from scanlock import Pose
from scanlock.experiments.crispness import (
    against,
    crispness_remarks,
    crispness_table,
    misleading_remarks,
)
from scanlock.experiments.pairwise import (
    TRUTH,
    chained,
    error_table,
    pair_table,
    rotation_errors_deg,
    tracks_of,
)

GOOD, BAD = (0.02, 0.001), (5.0, 0.5)


def test_a_chain_of_poses_is_a_trajectory(series):
    pairs = series.pairs()
    track = chained([record_of(pair, "a") for pair in pairs])
    assert len(track) == 4
    for pose, truth in zip(track, series.true_trajectory(), strict=True):
        assert pose.is_close(truth, translation=1e-9, rotation=1e-7)
    broken = chained([record_of(pairs[0], "a"), record_of(pairs[1], "a", pose=None)])
    assert broken[2] == broken[1] != Pose.identity()


def test_the_true_track_is_there_where_it_is_known(outcome_of, series):
    assert list(tracks_of(outcome_of({"a": [GOOD] * 3}))) == ["a", TRUTH]
    blind = outcome_of({"a": [GOOD] * 3}, replace(series, truth=()))
    assert list(tracks_of(blind)) == ["a"]


def test_the_table_of_errors_holds_the_boxes(outcome_of):
    errors = [(0.1, 0.01), (0.2, 0.012), (5.0, 0.5)]
    [row] = error_table(outcome_of({"a": errors})).rows
    assert row[:3] == ["a", 3, 2]
    assert row[3:7] == pytest.approx([0.15, 0.2, 2.6, 5.0])
    assert row[7:11] == pytest.approx(np.degrees([0.011, 0.012, 0.256, 0.5]).tolist())
    # All three were called ok, and one of them is not.
    assert row[11:] == [3, 1]


def test_a_method_without_a_pose_has_a_row_of_blanks(outcome_of):
    [row] = error_table(outcome_of({"a": [(math.nan, math.nan)] * 3})).rows
    assert all(math.isnan(value) for value in (*row[2:11], row[12]))


def test_the_table_of_pairs_names_scans_and_degrees(outcome_of):
    outcome = outcome_of({"a": [GOOD] * 3})
    table = pair_table(outcome)
    assert table.rows[1][:4] == ["a", "scan1", "scan2", "ok"]
    assert table.rows[1][5] == pytest.approx(math.degrees(0.001))
    assert rotation_errors_deg(outcome.records["a"]).tolist() == [math.degrees(0.001)] * 3


COUNTS = {"x": 110, "base": 100, "true": 90}
PRINTED = {"x": 1050, "base": 1000, "y": 990}


def test_the_table_of_crispness_sets_ours_beside_the_papers():
    rows = crispness_table(COUNTS, PRINTED, "base").rows
    assert rows[0] == ["x", 110, pytest.approx(0.1), 1050, pytest.approx(0.05)]
    assert rows[1][:2] == ["base", 100]
    assert rows[2][:2] == ["true", 90]
    assert math.isnan(rows[2][3])
    assert math.isnan(against(COUNTS, "x", "nothing"))


@pytest.mark.parametrize(
    ("count", "error", "side", "cause"),
    [
        (110, GOOD, "on the same side", "Neither lost a pair"),
        (95, BAD, "on the other side", "Pairs lost: 3 of 3 by x and 0 of 3 by base"),
    ],
)
def test_what_a_remark_says_follows_from_the_numbers(outcome_of, count, error, side, cause):
    outcome = outcome_of({"x": [error] * 3, "base": [GOOD] * 3})
    remarks = crispness_remarks(outcome, COUNTS | {"x": count}, PRINTED, "base")
    assert side in remarks[0]
    assert cause in remarks[0]
    assert "+5.00% in the paper" in remarks[0]
    assert remarks[1] == "y: not compared, for y was not run here."


def test_a_map_that_is_crisp_and_wrong_is_named(outcome_of, series):
    errors = {"x": [BAD] * 3, "y": [BAD, BAD, GOOD], "base": [GOOD] * 3}
    outcome = outcome_of(errors)
    counts = {"x": 90, "y": 110, "base": 100, TRUTH: 80}
    assert misleading_remarks(outcome, counts) == [
        "Crispness misleads on x: it fills fewer voxels than base and solved 0 pairs where base "
        "solved 3."
    ]
    assert misleading_remarks(outcome, counts | {"x": 120}) == []
    assert misleading_remarks(outcome_of(errors, replace(series, truth=())), counts) == []


def test_without_a_truth_a_remark_blames_nobody(outcome_of, series):
    blind = outcome_of({"x": [GOOD] * 3, "base": [GOOD] * 3}, replace(series, truth=()))
    assert "nobody can say" in crispness_remarks(blind, COUNTS, PRINTED, "base")[0]


def test_poses_of_the_pairs_are_the_step(series):
    assert series.pairs()[0].truth.is_close(STEP, translation=1e-12, rotation=1e-7)
