"""Claims of Madhavan and Messina 2003 on Table 1, and remarks on the other methods."""

from collections.abc import Sequence

from scanlock.experiments.experiment import Claim
from scanlock.experiments.ladar.outcome import LadarOutcome
from scanlock.experiments.ladar.rows import ROWS, PaperRow
from scanlock.experiments.ladar.tables import finite_median
from scanlock.experiments.pairwise import SOLVED

_MIN_SOLVED_RATIO = 0.75
"""Minimum ratio of solved places; the paper has one place."""


def ladar_claims(found: LadarOutcome, paper: str) -> list[Claim]:
    """Return the claims of the paper, evaluated with its own method.

    Parameters
    ----------
    found : LadarOutcome
    paper : str
        Name of the contender with the method of the paper.
    """
    first, second, third, fourth = ROWS
    return [
        *(_distance_claim(found, row, paper) for row in (first, second, third)),
        _iterations_claim(
            "Iterations increase from #2 to #3, where D is moved, and from #1 to #4.",
            found,
            [(second, third), (first, fourth)],
            paper,
        ),
        _farther_claim(
            "The mean distance of #4 exceeds that of #1.", found, (first, fourth), paper
        ),
        _solved_claim("The range images of #4 were sufficiently registered.", found, fourth, paper),
    ]


def ladar_remarks(found: LadarOutcome, paper: str) -> list[str]:
    """Return a sentence on each other contender in comparison with the paper."""
    first, fourth = ROWS[0], ROWS[-1]
    remarks: list[str] = []
    for name in found.outcome.records:
        if name == paper:
            continue
        remaining = {
            row: finite_median(found.distances(row.drive, row.start, name)) for row in ROWS
        }
        near = [row.name for row in ROWS if remaining[row] <= row.distance]
        solved = found.solved(fourth.drive, fourth.start, name)
        side = "within" if remaining[fourth] <= first.distance else "above"
        remarks.append(
            f"{name} is within the paper's mean distance on {', '.join(near) or 'no row'}. It "
            f"solves {fourth.name} at {solved} of {found.places} places with a mean distance of "
            f"{_cm(remaining[fourth])}, {side} the {_cm(first.distance)} of {first.name} in the "
            f"paper, where {fourth.name} has {_cm(fourth.distance)}."
        )
    return remarks


def _distance_claim(found: LadarOutcome, row: PaperRow, paper: str) -> Claim:
    distance = finite_median(found.distances(row.drive, row.start, paper))
    exact = finite_median(found.exact_distances(row.drive))
    return Claim(
        statement=f"{row.name} ends at a mean distance of {_cm(row.distance)} or less.",
        holds=distance <= row.distance,
        reason=f"{_cm(distance)}, and {_cm(exact)} at the exact pose",
    )


def _iterations_claim(
    statement: str, found: LadarOutcome, rises: Sequence[tuple[PaperRow, PaperRow]], paper: str
) -> Claim:
    counts = [tuple(_iterations(found, row, paper) for row in pair) for pair in rises]
    listed = ", ".join(
        f"{fewer.name} {few:.0f}, {more.name} {many:.0f}"
        for (fewer, more), (few, many) in zip(rises, counts, strict=True)
    )
    return Claim(
        statement=statement,
        holds=all(few < many for few, many in counts),
        reason=f"median iterations: {listed}",
    )


def _farther_claim(
    statement: str, found: LadarOutcome, rows: tuple[PaperRow, PaperRow], paper: str
) -> Claim:
    near, far = (finite_median(found.distances(row.drive, row.start, paper)) for row in rows)
    return Claim(
        statement=statement,
        holds=near < far,
        reason=f"median mean distance: {rows[0].name} {_cm(near)}, {rows[1].name} {_cm(far)}",
    )


def _solved_claim(statement: str, found: LadarOutcome, row: PaperRow, paper: str) -> Claim:
    solved = found.solved(row.drive, row.start, paper)
    return Claim(
        statement=statement,
        holds=solved >= _MIN_SOLVED_RATIO * found.places,
        reason=f"{solved} of {found.places} places solved within {SOLVED}; at least 75 % required",
    )


def _iterations(found: LadarOutcome, row: PaperRow, name: str) -> float:
    records = found.records(row.drive, row.start, name)
    return finite_median([float(record.evaluations) for record in records])


def _cm(metres: float) -> str:
    return f"{100.0 * metres:.2f} cm"
