from dataclasses import replace

import pytest

from scanlock.experiments import claims

GOOD, FAIR, BAD = (0.02, 0.001), (0.2, 0.001), (5.0, 0.5)


def test_accurate_requires_three_quarters_of_the_pairs_of_each_method(outcome_of):
    outcome = outcome_of({"a": [GOOD] * 3, "b": [GOOD, GOOD, BAD]})
    assert claims.accurate("", outcome, ["a"]).holds
    claim = claims.accurate("a statement", outcome, ["a", "b"])
    assert (claim.statement, claim.holds) == ("a statement", False)
    assert "at least 75% of the pairs required: a 100%, b 67%" in claim.reason


def test_more_accurate_compares_medians(outcome_of):
    outcome = outcome_of({"a": [GOOD, GOOD, BAD], "b": [FAIR] * 3})
    assert claims.more_accurate("", outcome, ["a"], ["b"]).holds
    assert not claims.more_accurate("", outcome, ["b"], ["a"]).holds
    assert not claims.more_accurate("", outcome, ["a"], ["a"]).holds


def test_low_errors_are_within_the_tolerance(outcome_of):
    outcome = outcome_of({"a": [GOOD, FAIR, BAD], "b": [GOOD, BAD, BAD]})
    assert claims.low_errors("", outcome, "a").holds
    claim = claims.low_errors("", outcome, "b")
    assert not claim.holds
    assert "at most 0.3 m allowed" in claim.reason


def test_loses_pairs_requires_fewer_solved_pairs_than_every_other_method(outcome_of):
    outcome = outcome_of({"a": [GOOD] * 3, "b": [GOOD, BAD, GOOD], "c": [BAD] * 3})
    assert claims.loses_pairs("", outcome, "c", ["a", "b"]).holds
    assert not claims.loses_pairs("", outcome, "b", ["a", "c"]).holds


def test_largest_errors_compares_upper_quartiles(outcome_of):
    outcome = outcome_of({"a": [GOOD, FAIR, GOOD], "b": [GOOD, FAIR, BAD]})
    assert claims.largest_errors("", outcome, "b", ["a"]).holds
    assert not claims.largest_errors("", outcome, "a", ["b"]).holds


def test_a_method_without_any_pose_is_the_worst(outcome_of):
    nan = (float("nan"), float("nan"))
    outcome = outcome_of({"a": [BAD] * 3, "b": [nan] * 3})
    assert claims.more_accurate("", outcome, ["a"], ["b"]).holds
    assert claims.largest_errors("", outcome, "b", ["a"]).holds


def test_crispness_claims_compare_voxel_counts():
    counts = {"a": 100, "b": 101, "c": 110}
    assert claims.crisper("", counts, ["a", "b"], ["c"]).holds
    assert not claims.crisper("", counts, ["a", "c"], ["b"]).holds
    assert claims.equally_crisp("", counts, ["a", "b"], 0.02).holds
    claim = claims.equally_crisp("", counts, ["a", "b", "c"], 0.02)
    assert not claim.holds
    assert "a difference of 10.00%, at most 2% allowed" in claim.reason


@pytest.mark.parametrize(
    "kind", ["accurate", "low_errors", "more_accurate", "loses_pairs", "largest_errors"]
)
def test_claims_are_undecided_without_the_method_or_the_truth(outcome_of, series, kind):
    arguments = {
        "accurate": (["a", "b"],),
        "low_errors": ("b",),
        "more_accurate": (["a"], ["b"]),
        "loses_pairs": ("a", ["b"]),
        "largest_errors": ("a", ["b"]),
    }[kind]
    claim = getattr(claims, kind)("", outcome_of({"a": [GOOD] * 3}), *arguments)
    assert (claim.holds, claim.reason) == (None, "b was not run")
    blind = outcome_of({"a": [GOOD] * 3, "b": [GOOD] * 3}, replace(series, truth=()))
    claim = getattr(claims, kind)("", blind, *arguments)
    assert (claim.holds, claim.reason) == (None, "the true poses are not known")


def test_crispness_claims_are_undecided_without_the_maps():
    assert claims.crisper("", {"a": 1}, ["a"], ["b"]).holds is None
    assert claims.equally_crisp("", {"a": 1}, ["a", "b"], 0.1).holds is None


def test_claims_on_few_pairs_are_undecided(outcome_of):
    outcome = outcome_of({"a": [GOOD] * 3, "b": [BAD] * 3})
    found = [claims.accurate("all", outcome, ["a"]), claims.accurate("none", outcome, ["b"])]
    assert [claim.holds for claim in claims.judged(found, claims.MIN_PAIRS)] == [True, False]
    few = claims.judged(found, claims.MIN_PAIRS - 1, "places")
    assert [claim.statement for claim in few] == ["all", "none"]
    assert {claim.holds for claim in few} == {None}
    assert few[0].reason == "too few places to judge: 9, at least 10 needed"
