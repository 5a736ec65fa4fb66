import math
from dataclasses import replace

import numpy as np
import pytest

from reference.studies import STEP, record_of
from scanlock import Pose
from scanlock.experiments.crispness import (
    crispness_remarks,
    crispness_table,
    misleading_remarks,
    relative_count,
)
from scanlock.experiments.pairwise import (
    TRUTH,
    chained,
    error_table,
    pair_table,
    rotation_errors_deg,
    trajectories_of,
)

GOOD, BAD = (0.02, 0.001), (5.0, 0.5)


def test_a_chain_of_poses_is_a_trajectory(series):
    pairs = series.pairs()
    trajectory = chained([record_of(pair, "a") for pair in pairs])
    assert len(trajectory) == 4
    for pose, truth in zip(trajectory, series.true_trajectory(), strict=True):
        assert pose.is_close(truth, translation=1e-9, rotation=1e-7)
    broken = chained([record_of(pairs[0], "a"), record_of(pairs[1], "a", pose=None)])
    assert broken[2] == broken[1] != Pose.identity()


def test_the_true_trajectory_is_included_if_known(outcome_of, series):
    assert list(trajectories_of(outcome_of({"a": [GOOD] * 3}))) == ["a", TRUTH]
    blind = outcome_of({"a": [GOOD] * 3}, replace(series, truth=()))
    assert list(trajectories_of(blind)) == ["a"]


def test_the_error_table_has_the_quartiles_of_the_box_plots(outcome_of):
    errors = [(0.1, 0.01), (0.2, 0.012), (5.0, 0.5)]
    [row] = error_table(outcome_of({"a": errors})).rows
    assert row[:3] == ["a", 3, 2]
    assert row[3:7] == pytest.approx([0.15, 0.2, 2.6, 5.0])
    assert row[7:11] == pytest.approx(np.degrees([0.011, 0.012, 0.256, 0.5]).tolist())
    # All three have status ok, and one of them is wrong.
    assert row[11:] == [3, 1]


def test_a_method_without_a_pose_has_empty_cells(outcome_of):
    [row] = error_table(outcome_of({"a": [(math.nan, math.nan)] * 3})).rows
    assert all(math.isnan(value) for value in (*row[2:11], row[12]))


def test_the_pair_table_has_scan_names_and_degrees(outcome_of):
    outcome = outcome_of({"a": [GOOD] * 3})
    table = pair_table(outcome)
    assert table.rows[1][:4] == ["a", "scan1", "scan2", "ok"]
    assert table.rows[1][5] == pytest.approx(math.degrees(0.001))
    assert rotation_errors_deg(outcome.records["a"]).tolist() == [math.degrees(0.001)] * 3


COUNTS = {"x": 110, "base": 100, "true": 90}
PUBLISHED = {"x": 1050, "base": 1000, "y": 990}


def test_the_crispness_table_has_the_counts_of_the_paper():
    rows = crispness_table(COUNTS, PUBLISHED, "base").rows
    assert rows[0] == ["x", 110, pytest.approx(0.1), 1050, pytest.approx(0.05)]
    assert rows[1][:2] == ["base", 100]
    assert rows[2][:2] == ["true", 90]
    assert math.isnan(rows[2][3])
    assert math.isnan(relative_count(COUNTS, "x", "nothing"))


@pytest.mark.parametrize(
    ("count", "error", "side", "cause"),
    [
        (110, GOOD, "the same sign", "Neither lost a pair"),
        (95, BAD, "the opposite sign", "Pairs lost: 3 of 3 by x and 0 of 3 by base"),
    ],
)
def test_crispness_remarks_name_the_sign_and_the_cause(outcome_of, count, error, side, cause):
    outcome = outcome_of({"x": [error] * 3, "base": [GOOD] * 3})
    remarks = crispness_remarks(outcome, COUNTS | {"x": count}, PUBLISHED, "base")
    assert side in remarks[0]
    assert cause in remarks[0]
    assert "+5.00% in the paper" in remarks[0]
    assert remarks[1] == "y: not compared, because y was not run."


def test_a_crisp_map_with_fewer_solved_pairs_is_reported(outcome_of, series):
    errors = {"x": [BAD] * 3, "y": [BAD, BAD, GOOD], "base": [GOOD] * 3}
    outcome = outcome_of(errors)
    counts = {"x": 90, "y": 110, "base": 100, TRUTH: 80}
    assert misleading_remarks(outcome, counts) == [
        "Crispness is misleading for x: it fills fewer voxels than base, but solves 0 pairs where "
        "base solves 3."
    ]
    assert misleading_remarks(outcome, counts | {"x": 120}) == []
    assert misleading_remarks(outcome_of(errors, replace(series, truth=())), counts) == []


def test_crispness_remarks_name_no_lost_pairs_without_a_truth(outcome_of, series):
    blind = outcome_of({"x": [GOOD] * 3, "base": [GOOD] * 3}, replace(series, truth=()))
    assert (
        "the number of lost pairs is unknown"
        in crispness_remarks(blind, COUNTS, PUBLISHED, "base")[0]
    )


def test_poses_of_the_pairs_are_the_step(series):
    assert series.pairs()[0].truth.is_close(STEP, translation=1e-12, rotation=1e-7)
