"""Claims of a paper, each with the condition that decides it."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from scanlock.evaluation.box_plot import box_plot
from scanlock.experiments.experiment import Claim, Outcome
from scanlock.experiments.pairwise import SOLVED, translation_errors

_MIN_SOLVED_RATIO = 0.75
"""Minimum ratio of solved pairs of an accurate method."""


MIN_PAIRS = 10
"""Minimum number of pairs that decide a claim: with fewer, one lost pair changes the answer."""


def undecided(statement: str, reason: str) -> Claim:
    """Return a claim that the data do not decide."""
    return Claim(statement=statement, holds=None, reason=reason)


def judged(claims: Sequence[Claim], count: int, noun: str = "pairs") -> list[Claim]:
    """Return claims on a number of pairs; with fewer than `MIN_PAIRS` all are undecided.

    Parameters
    ----------
    claims : sequence of Claim
    count : int
        Number of pairs, or of what `noun` says.
    noun : str
        Plural of the items.
    """
    if count >= MIN_PAIRS:
        return list(claims)
    few = f"too few {noun} to judge: {count}, at least {MIN_PAIRS} needed"
    return [undecided(claim.statement, few) for claim in claims]


def missing(outcome: Outcome, names: Sequence[str], *, truth: bool) -> str:
    """Return the reason why the data do not decide; empty if they do."""
    absent = [name for name in names if name not in outcome.records]
    if absent:
        return f"{', '.join(absent)} was not run"
    if truth and not outcome.series.truth:
        return "the true poses are not known"
    return ""


def accurate(statement: str, outcome: Outcome, names: Sequence[str]) -> Claim:
    """Claim that each of some methods solves at least three quarters of the pairs."""
    reason = missing(outcome, names, truth=True)
    if reason:
        return undecided(statement, reason)
    ratios = {name: _solved_ratio(outcome, name) for name in names}
    return Claim(
        statement=statement,
        holds=all(ratio >= _MIN_SOLVED_RATIO for ratio in ratios.values()),
        reason=f"solved within {SOLVED}, at least {_MIN_SOLVED_RATIO:.0%} of the pairs required: "
        f"{_listed(ratios, '.0%')}",
    )


def low_errors(statement: str, outcome: Outcome, name: str) -> Claim:
    """Claim that the median translation error of a method is within the tolerance."""
    reason = missing(outcome, [name], truth=True)
    if reason:
        return undecided(statement, reason)
    median = _median(outcome, name)
    return Claim(
        statement=statement,
        holds=median <= SOLVED.metres,
        reason=f"median translation error {median:.3f} m, at most {SOLVED.metres:g} m allowed",
    )


def more_accurate(
    statement: str, outcome: Outcome, better: Sequence[str], worse: Sequence[str]
) -> Claim:
    """Claim that some methods have a smaller median translation error than others."""
    reason = missing(outcome, [*better, *worse], truth=True)
    if reason:
        return undecided(statement, reason)
    medians = {name: _median(outcome, name) for name in (*better, *worse)}
    return Claim(
        statement=statement,
        holds=max(medians[name] for name in better) < min(medians[name] for name in worse),
        reason=f"median translation error: {_listed(medians, '.3f', ' m')}",
    )


def loses_pairs(statement: str, outcome: Outcome, name: str, than: Sequence[str]) -> Claim:
    """Claim that a method solves fewer pairs than each of the others."""
    reason = missing(outcome, [name, *than], truth=True)
    if reason:
        return undecided(statement, reason)
    ratios = {one: _solved_ratio(outcome, one) for one in (name, *than)}
    return Claim(
        statement=statement,
        holds=all(ratios[name] < ratios[other] for other in than),
        reason=f"solved within {SOLVED}: {_listed(ratios, '.0%')}",
    )


def largest_errors(statement: str, outcome: Outcome, name: str, than: Sequence[str]) -> Claim:
    """Claim that a method has a larger upper quartile of the translation error than others."""
    reason = missing(outcome, [name, *than], truth=True)
    if reason:
        return undecided(statement, reason)
    quartiles = {one: _upper_quartile(outcome, one) for one in (name, *than)}
    return Claim(
        statement=statement,
        holds=all(quartiles[name] > quartiles[other] for other in than),
        reason=f"upper quartile of the translation error: {_listed(quartiles, '.3f', ' m')}",
    )


def crisper(
    statement: str, counts: Mapping[str, int], better: Sequence[str], worse: Sequence[str]
) -> Claim:
    """Claim that the maps of some methods fill fewer voxels than those of others."""
    absent = [name for name in (*better, *worse) if name not in counts]
    if absent:
        return undecided(statement, f"{', '.join(absent)} was not run")
    named = {name: counts[name] for name in (*better, *worse)}
    return Claim(
        statement=statement,
        holds=max(counts[name] for name in better) < min(counts[name] for name in worse),
        reason=f"filled voxels: {_listed(named, ',d')}",
    )


def equally_crisp(
    statement: str, counts: Mapping[str, int], names: Sequence[str], max_difference: float
) -> Claim:
    """Claim that the numbers of filled voxels of maps differ by at most a given ratio."""
    absent = [name for name in names if name not in counts]
    if absent:
        return undecided(statement, f"{', '.join(absent)} was not run")
    named = {name: counts[name] for name in names}
    difference = max(named.values()) / min(named.values()) - 1.0
    return Claim(
        statement=statement,
        holds=difference <= max_difference,
        reason=f"filled voxels: {_listed(named, ',d')}, a difference of {difference:.2%}, at "
        f"most {max_difference:.0%} allowed",
    )


def _solved_ratio(outcome: Outcome, name: str) -> float:
    return float(np.mean([SOLVED.accepts(record) for record in outcome.records[name]]))


def _median(outcome: Outcome, name: str) -> float:
    errors = translation_errors(outcome.records[name])
    return box_plot(errors).median if np.isfinite(errors).any() else math.inf


def _upper_quartile(outcome: Outcome, name: str) -> float:
    errors = translation_errors(outcome.records[name])
    return box_plot(errors).upper_quartile if np.isfinite(errors).any() else math.inf


def _listed(values: Mapping[str, float], number_format: str, unit: str = "") -> str:
    return ", ".join(f"{name} {value:{number_format}}{unit}" for name, value in values.items())
