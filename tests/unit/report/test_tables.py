import csv
import io
import math

import pytest

from scanlock.errors import InvalidInput
from scanlock.report.tables import Column, Table

TABLE = Table(
    [Column("method"), Column("error [m]", ".3f"), Column("voxels", ",")],
    [["a|b", 1.0 / 3.0, 12345], ["c, d", math.nan, 7]],
)


def test_people_see_rounded_numbers_and_a_dash_for_none():
    assert TABLE.texts() == [["a|b", "0.333", "12,345"], ["c, d", "-", "7"]]
    assert TABLE.to_markdown() == (
        "| method | error [m] | voxels |\n"
        "| :--- | ---: | ---: |\n"
        "| a\\|b | 0.333 | 12,345 |\n"
        "| c, d | - | 7 |\n"
    )


def test_programs_read_every_digit_back():
    rows = list(csv.reader(io.StringIO(TABLE.to_csv())))
    assert rows[0] == ["method", "error [m]", "voxels"]
    assert float(rows[1][1]) == 1.0 / 3.0
    assert rows[2] == ["c, d", "", "7"]
    assert "\r" not in TABLE.to_csv()


def test_rows_fit_under_the_heads():
    with pytest.raises(InvalidInput, match="a row must have 1 cells, got 2"):
        Table([Column("a")], [["x", "y"]])
