"""What Madhavan and Messina 2003 say of Table 1, and what is to be said of it here."""

from collections.abc import Sequence

from scanlock.experiments.experiment import Claim
from scanlock.experiments.ladar.outcome import LadarOutcome
from scanlock.experiments.ladar.rows import ROWS, PaperRow
from scanlock.experiments.ladar.tables import middle
from scanlock.experiments.pairwise import SOLVED

_MOST = 0.75
"""Share of the places that is asked where the paper shows one."""


def ladar_claims(found: LadarOutcome, paper: str) -> list[Claim]:
    """Return the statements of the paper, held against its own method.

    Parameters
    ----------
    found : LadarOutcome
    paper : str
        The contender that is the paper's method.
    """
    first, second, third, fourth = ROWS
    return [
        *(_distance_claim(found, row, paper) for row in (first, second, third)),
        _iterations_claim(
            "Iterations rise from #2 to #3, where D is moved, and from #1 to #4.",
            found,
            [(second, third), (first, fourth)],
            paper,
        ),
        _farther_claim(
            "The mean distance of #4 is above that of #1.", found, (first, fourth), paper
        ),
        _solved_claim("The range images of #4 were sufficiently registered.", found, fourth, paper),
    ]


def ladar_remarks(found: LadarOutcome, paper: str) -> list[str]:
    """Return where others go beyond the paper's method: a sentence on each contender."""
    first, fourth = ROWS[0], ROWS[-1]
    remarks: list[str] = []
    for name in found.outcome.records:
        if name == paper:
            continue
        left = {row: middle(found.distances(row.drive, row.start, name)) for row in ROWS}
        near = [row.name for row in ROWS if left[row] <= row.distance]
        solved = found.solved(fourth.drive, fourth.start, name)
        side = "within" if left[fourth] <= first.distance else "above"
        remarks.append(
            f"{name} ends within the paper's mean distance on {', '.join(near) or 'no row'}. It "
            f"solves {fourth.name} at {solved} of {found.places} places and leaves "
            f"{_cm(left[fourth])} there, {side} the {_cm(first.distance)} of the paper's "
            f"{first.name}; the paper's own {fourth.name} ended at {_cm(fourth.distance)}."
        )
    return remarks


def _distance_claim(found: LadarOutcome, row: PaperRow, paper: str) -> Claim:
    left = middle(found.distances(row.drive, row.start, paper))
    floor = middle(found.exact_distances(row.drive))
    return Claim(
        says=f"{row.name} ends at a mean distance of {_cm(row.distance)}, or less.",
        holds=left <= row.distance,
        because=f"{_cm(left)}, where the exact pose leaves {_cm(floor)}",
    )


def _iterations_claim(
    says: str, found: LadarOutcome, rises: Sequence[tuple[PaperRow, PaperRow]], paper: str
) -> Claim:
    counts = [tuple(_iterations(found, row, paper) for row in pair) for pair in rises]
    listed = ", ".join(
        f"{fewer.name} {few:.0f}, {more.name} {many:.0f}"
        for (fewer, more), (few, many) in zip(rises, counts, strict=True)
    )
    return Claim(
        says=says,
        holds=all(few < many for few, many in counts),
        because=f"median iterations: {listed}",
    )


def _farther_claim(
    says: str, found: LadarOutcome, rows: tuple[PaperRow, PaperRow], paper: str
) -> Claim:
    near, far = (middle(found.distances(row.drive, row.start, paper)) for row in rows)
    return Claim(
        says=says,
        holds=near < far,
        because=f"median mean distance: {rows[0].name} {_cm(near)}, {rows[1].name} {_cm(far)}",
    )


def _solved_claim(says: str, found: LadarOutcome, row: PaperRow, paper: str) -> Claim:
    solved = found.solved(row.drive, row.start, paper)
    return Claim(
        says=says,
        holds=solved >= _MOST * found.places,
        because=f"{solved} of {found.places} places solved within {SOLVED}, of which three "
        "quarters are asked",
    )


def _iterations(found: LadarOutcome, row: PaperRow, name: str) -> float:
    records = found.records(row.drive, row.start, name)
    return middle([float(record.evaluations) for record in records])


def _cm(metres: float) -> str:
    return f"{100.0 * metres:.2f} cm"
