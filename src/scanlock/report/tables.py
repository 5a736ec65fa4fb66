"""Tables with three outputs: texts for the screen, Markdown, and CSV with full precision."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.errors import InvalidInput

Cell = str | int | float

_MISSING = "-"
"""Text of a missing number."""


@dataclass(frozen=True, slots=True)
class Column:
    """Header of a column with the unit, and the format of its numbers (``".3f"``)."""

    head: str
    """Header with the unit."""

    number_format: str = ""
    """Format specification of the numbers."""

    def text(self, value: Cell) -> str:
        """Return the rounded text of a cell."""
        if isinstance(value, str):
            return value
        return _MISSING if math.isnan(value) else format(value, self.number_format)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of texts and numbers with column headers; NaN is a missing number.

    Raises
    ------
    InvalidInput
        A row has more or fewer cells than there are columns.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInput(f"a row must have {len(self.columns)} cells, got {len(row)}")

    @property
    def heads(self) -> list[str]:
        """Headers of the columns."""
        return [column.head for column in self.columns]

    def texts(self) -> list[list[str]]:
        """Return the rounded texts of all cells."""
        return [
            [column.text(value) for column, value in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def to_markdown(self) -> str:
        """Return the table in Markdown with rounded numbers, aligned to the right."""
        rule = [":---", *(["---:"] * (len(self.columns) - 1))]
        lines = [self.heads, rule, *self.texts()]
        return "".join(f"| {' | '.join(map(_escaped, line))} |\n" for line in lines)

    def to_csv(self) -> str:
        """Return the table as CSV with full precision and empty cells for missing numbers."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.heads)
        writer.writerows([_plain(value) for value in row] for row in self.rows)
        return text.getvalue()


def _plain(value: Cell) -> str:
    if isinstance(value, str):
        return value
    # `repr` gives the shortest text that converts back to the same float.
    return "" if math.isnan(value) else repr(value)


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")
