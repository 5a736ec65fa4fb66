"""Table I of Das et al. 2013: how many voxels each map fills, ours beside the paper's."""

import math
from collections.abc import Mapping

from scanlock.experiments.experiment import Outcome
from scanlock.experiments.pairwise import SOLVED
from scanlock.report.tables import Cell, Column, Table


def crispness_table(counts: Mapping[str, int], printed: Mapping[str, int], baseline: str) -> Table:
    """Return Table I of the paper: ours, the paper's, and both against one method.

    Parameters
    ----------
    counts, printed : mapping of str to int
        Filled voxels here and in the paper, by method.
    baseline : str
        The method that the others are compared with, where it is there.
    """
    columns = [
        Column("method"),
        Column("voxels", ",d"),
        Column(f"against {baseline}", "+.2%"),
        Column("voxels in the paper", ",d"),
        Column(f"against {baseline} in the paper", "+.2%"),
    ]
    rows: list[list[Cell]] = []
    for name, count in counts.items():
        rows.append(
            [
                name,
                count,
                against(counts, name, baseline),
                printed.get(name, math.nan),
                against(printed, name, baseline),
            ]
        )
    return Table(columns, rows)


def crispness_remarks(
    outcome: Outcome, counts: Mapping[str, int], printed: Mapping[str, int], baseline: str
) -> list[str]:
    """Return a sentence on each number of the paper: on which side of the baseline ours is."""
    remarks: list[str] = []
    for name in printed:
        ours = against(counts, name, baseline)
        theirs = against(printed, name, baseline)
        if name == baseline:
            continue
        missing = [one for one in (name, baseline) if one not in counts]
        if missing:
            remarks.append(f"{name}: not compared, for {' and '.join(missing)} was not run here.")
            continue
        agree = "on the same side" if ours * theirs > 0 else "on the other side"
        remarks.append(
            f"{name} fills {ours:+.2%} voxels against {baseline} here and {theirs:+.2%} in the "
            f"paper, {agree} of it. {_chain_sentence(outcome, name, baseline)}"
        )
    return [*remarks, *misleading_remarks(outcome, counts)]


def misleading_remarks(outcome: Outcome, counts: Mapping[str, int]) -> list[str]:
    """Return where a map is the crisper for being wrong: a sentence for each such method.

    Scans that are laid on top of each other although the sensor moved fill few voxels too.
    """
    if not outcome.series.truth:
        return []
    solved = {
        name: sum(SOLVED.hold(record) for record in records)
        for name, records in outcome.records.items()
    }
    remarks: list[str] = []
    for name, count in counts.items():
        fooled = [
            other
            for other in solved
            if name in solved and count < counts[other] and solved[name] < solved[other]
        ]
        if fooled:
            best = max(fooled, key=lambda other: solved[other])
            remarks.append(
                f"Crispness misleads on {name}: it fills fewer voxels than {best} and solved "
                f"{solved[name]} pairs where {best} solved {solved[best]}."
            )
    return remarks


def against(counts: Mapping[str, int], name: str, baseline: str) -> float:
    """Return by which share a count is above that of the baseline; NaN where one is missing."""
    if name not in counts or baseline not in counts:
        return math.nan
    return counts[name] / counts[baseline] - 1.0


def _chain_sentence(outcome: Outcome, name: str, baseline: str) -> str:
    """Return whether lost pairs or small errors make the difference, where the truth tells."""
    if not outcome.series.truth:
        return "Without true poses nobody can say which pairs were lost."
    lost = {
        one: sum(not SOLVED.hold(record) for record in outcome.records[one])
        for one in (name, baseline)
    }
    if not any(lost.values()):
        return f"Neither lost a pair: errors below {SOLVED} a pair make the difference."
    counts = " and ".join(
        f"{count} of {len(outcome.records[one])} by {one}" for one, count in lost.items()
    )
    return (
        f"Pairs lost: {counts}; everything after a lost pair is laid in the wrong place, "
        "and what the sensor sees twice there fills its voxels twice."
    )
