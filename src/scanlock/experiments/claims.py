"""Sentences of a paper, each with the condition that decides whether it is so here."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from scanlock.evaluation.box_plot import box_plot
from scanlock.experiments.experiment import Claim, Outcome
from scanlock.experiments.pairwise import (
    SOLVED,
    translation_errors,
)


def undecided(says: str, why: str) -> Claim:
    """Return a claim that these data cannot decide."""
    return Claim(says=says, holds=None, because=why)


def missing(outcome: Outcome, names: Sequence[str], *, truth: bool) -> str:
    """Return what it takes to decide and is not there; empty when all is there."""
    absent = [name for name in names if name not in outcome.records]
    if absent:
        return f"{', '.join(absent)} was not run"
    if truth and not outcome.series.truth:
        return "the true poses are not known"
    return ""


def accurate(says: str, outcome: Outcome, names: Sequence[str]) -> Claim:
    """Claim that methods are accurate: each solves at least three quarters of the pairs."""
    why = missing(outcome, names, truth=True)
    if why:
        return undecided(says, why)
    shares = {name: _solved_share(outcome, name) for name in names}
    return Claim(
        says=says,
        holds=all(share >= 0.75 for share in shares.values()),
        because=f"solved within {SOLVED}, of which three "
        f"quarters are asked: {_listed(shares, '.0%')}",
    )


def low_errors(says: str, outcome: Outcome, name: str) -> Claim:
    """Claim that the median translation error of a method is within the limit of solved pairs."""
    why = missing(outcome, [name], truth=True)
    if why:
        return undecided(says, why)
    median = _median(outcome, name)
    return Claim(
        says=says,
        holds=median <= SOLVED.metres,
        because=f"median translation error {median:.3f} m, where {SOLVED.metres:g} m are allowed",
    )


def more_accurate(
    says: str, outcome: Outcome, better: Sequence[str], worse: Sequence[str]
) -> Claim:
    """Claim that the median translation error of some methods is below that of others."""
    why = missing(outcome, [*better, *worse], truth=True)
    if why:
        return undecided(says, why)
    medians = {name: _median(outcome, name) for name in (*better, *worse)}
    return Claim(
        says=says,
        holds=max(medians[name] for name in better) < min(medians[name] for name in worse),
        because=f"median translation error: {_listed(medians, '.3f', ' m')}",
    )


def loses_pairs(says: str, outcome: Outcome, name: str, than: Sequence[str]) -> Claim:
    """Claim that a method solves fewer pairs than each of the others."""
    why = missing(outcome, [name, *than], truth=True)
    if why:
        return undecided(says, why)
    shares = {one: _solved_share(outcome, one) for one in (name, *than)}
    return Claim(
        says=says,
        holds=all(shares[name] < shares[other] for other in than),
        because=f"solved within {SOLVED}: {_listed(shares, '.0%')}",
    )


def largest_errors(says: str, outcome: Outcome, name: str, than: Sequence[str]) -> Claim:
    """Claim that a quarter of a method's translation errors are worse than of the others."""
    why = missing(outcome, [name, *than], truth=True)
    if why:
        return undecided(says, why)
    quartiles = {one: _upper_quartile(outcome, one) for one in (name, *than)}
    return Claim(
        says=says,
        holds=all(quartiles[name] > quartiles[other] for other in than),
        because=f"upper quartile of the translation error: {_listed(quartiles, '.3f', ' m')}",
    )


def crisper(
    says: str, counts: Mapping[str, int], better: Sequence[str], worse: Sequence[str]
) -> Claim:
    """Claim that each map of some methods fills fewer voxels than each of the others."""
    absent = [name for name in (*better, *worse) if name not in counts]
    if absent:
        return undecided(says, f"{', '.join(absent)} was not run")
    named = {name: counts[name] for name in (*better, *worse)}
    return Claim(
        says=says,
        holds=max(counts[name] for name in better) < min(counts[name] for name in worse),
        because=f"filled voxels: {_listed(named, ',d')}",
    )


def alike(says: str, counts: Mapping[str, int], names: Sequence[str], within: float) -> Claim:
    """Claim that maps fill as many voxels as each other, within a share."""
    absent = [name for name in names if name not in counts]
    if absent:
        return undecided(says, f"{', '.join(absent)} was not run")
    named = {name: counts[name] for name in names}
    gap = max(named.values()) / min(named.values()) - 1.0
    return Claim(
        says=says,
        holds=gap <= within,
        because=f"filled voxels: {_listed(named, ',d')}, which is {gap:.2%} apart where "
        f"{within:.0%} are allowed",
    )


def _solved_share(outcome: Outcome, name: str) -> float:
    return float(np.mean([SOLVED.hold(record) for record in outcome.records[name]]))


def _median(outcome: Outcome, name: str) -> float:
    errors = translation_errors(outcome.records[name])
    return box_plot(errors).median if np.isfinite(errors).any() else math.inf


def _upper_quartile(outcome: Outcome, name: str) -> float:
    errors = translation_errors(outcome.records[name])
    return box_plot(errors).upper_quartile if np.isfinite(errors).any() else math.inf


def _listed(values: Mapping[str, float], form: str, unit: str = "") -> str:
    return ", ".join(f"{name} {value:{form}}{unit}" for name, value in values.items())
