"""One table, three ways: aligned text, Markdown for people, CSV with every digit."""

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

from scanlock.errors import InvalidInput

Cell = str | int | float

_NOTHING = "-"
"""What people see of a number that is not there."""


@dataclass(frozen=True, slots=True)
class Column:
    """The head of a column, with the unit, and how people read its numbers (``".3f"``)."""

    head: str
    form: str = ""

    def text(self, value: Cell) -> str:
        """Return a cell for people."""
        if isinstance(value, str):
            return value
        return _NOTHING if math.isnan(value) else format(value, self.form)


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of text and numbers under their heads; NaN stands for a number that is not there.

    Raises
    ------
    InvalidInput
        A row with more or fewer cells than there are columns.
    """

    columns: Sequence[Column]
    rows: Sequence[Sequence[Cell]]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise InvalidInput(f"a row must have {len(self.columns)} cells, got {len(row)}")

    @property
    def heads(self) -> list[str]:
        """The names of the columns."""
        return [column.head for column in self.columns]

    def texts(self) -> list[list[str]]:
        """Return the cells for people, rounded."""
        return [
            [column.text(value) for column, value in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]

    def to_markdown(self) -> str:
        """Return the table for people, numbers rounded and to the right."""
        rule = [":---", *(["---:"] * (len(self.columns) - 1))]
        lines = [self.heads, rule, *self.texts()]
        return "".join(f"| {' | '.join(map(_escaped, line))} |\n" for line in lines)

    def to_csv(self) -> str:
        """Return the table for programs: every digit, nothing where a number is not there."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(self.heads)
        writer.writerows([_plain(value) for value in row] for row in self.rows)
        return text.getvalue()


def _plain(value: Cell) -> str:
    if isinstance(value, str):
        return value
    # Written with `repr`, a float has as many digits as it takes to read the same one back.
    return "" if math.isnan(value) else repr(value)


def _escaped(text: str) -> str:
    return text.replace("|", "\\|")
