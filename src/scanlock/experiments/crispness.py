"""Table I of Das et al. 2013: filled voxels of each map, here and in the paper."""

import math
from collections.abc import Mapping

from scanlock.experiments.experiment import Outcome, Section
from scanlock.experiments.pairwise import SOLVED
from scanlock.report.tables import Cell, Column, Table


def crispness_section(
    outcome: Outcome, counts: Mapping[str, int], published: Mapping[str, int], baseline: str
) -> Section:
    """Return the section of a page with Table I and remarks on it; see `crispness_table`."""
    return Section(
        title="Crispness of the maps (Table I)",
        tables={"crispness": crispness_table(counts, published, baseline)},
        remarks=crispness_remarks(outcome, counts, published, baseline),
    )


def crispness_table(
    counts: Mapping[str, int], published: Mapping[str, int], baseline: str
) -> Table:
    """Return Table I: filled voxels here and in the paper, and both relative to one method.

    Parameters
    ----------
    counts, published : mapping of str to int
        Filled voxels here and in the paper, by method.
    baseline : str
        Method of the relative numbers.
    """
    columns = [
        Column("method"),
        Column("voxels", ",d"),
        Column(f"relative to {baseline}", "+.2%"),
        Column("voxels in the paper", ",d"),
        Column(f"relative to {baseline} in the paper", "+.2%"),
    ]
    rows: list[list[Cell]] = []
    for name, count in counts.items():
        rows.append(
            [
                name,
                count,
                relative_count(counts, name, baseline),
                published.get(name, math.nan),
                relative_count(published, name, baseline),
            ]
        )
    return Table(columns, rows)


def crispness_remarks(
    outcome: Outcome, counts: Mapping[str, int], published: Mapping[str, int], baseline: str
) -> list[str]:
    """Return a sentence on each number of the paper, with its sign here and in the paper."""
    remarks: list[str] = []
    for name in published:
        here = relative_count(counts, name, baseline)
        paper = relative_count(published, name, baseline)
        if name == baseline:
            continue
        missing = [one for one in (name, baseline) if one not in counts]
        if missing:
            remarks.append(f"{name}: not compared, because {' and '.join(missing)} was not run.")
            continue
        sign = "the same sign" if here * paper > 0 else "the opposite sign"
        remarks.append(
            f"{name} fills {here:+.2%} voxels relative to {baseline} here and {paper:+.2%} in the "
            f"paper, {sign}. {_cause_sentence(outcome, name, baseline)}"
        )
    return [*remarks, *misleading_remarks(outcome, counts)]


def misleading_remarks(outcome: Outcome, counts: Mapping[str, int]) -> list[str]:
    """Return a sentence for each method with fewer voxels and fewer solved pairs than another.

    A trajectory that underestimates the motion puts all scans in one place, which fills few
    voxels.
    """
    if not outcome.series.truth:
        return []
    solved = {
        name: sum(SOLVED.accepts(record) for record in records)
        for name, records in outcome.records.items()
    }
    remarks: list[str] = []
    for name, count in counts.items():
        better = [
            other
            for other in solved
            if name in solved and count < counts[other] and solved[name] < solved[other]
        ]
        if better:
            best = max(better, key=lambda other: solved[other])
            remarks.append(
                f"Crispness is misleading for {name}: it fills fewer voxels than {best}, but "
                f"solves {solved[name]} pairs where {best} solves {solved[best]}."
            )
    return remarks


def relative_count(counts: Mapping[str, int], name: str, baseline: str) -> float:
    """Return the relative difference to the baseline; NaN where a count is missing."""
    if name not in counts or baseline not in counts:
        return math.nan
    return counts[name] / counts[baseline] - 1.0


def _cause_sentence(outcome: Outcome, name: str, baseline: str) -> str:
    """Return whether lost pairs or small errors cause the difference, as far as known."""
    if not outcome.series.truth:
        return "Without true poses the number of lost pairs is unknown."
    lost = {
        one: sum(not SOLVED.accepts(record) for record in outcome.records[one])
        for one in (name, baseline)
    }
    if not any(lost.values()):
        return f"Neither lost a pair: errors within {SOLVED} per pair cause the difference."
    counts = " and ".join(
        f"{count} of {len(outcome.records[one])} by {one}" for one, count in lost.items()
    )
    return (
        f"Pairs lost: {counts}. All scans after a lost pair have a wrong pose, so surfaces that "
        "are seen twice fill twice as many voxels."
    )
