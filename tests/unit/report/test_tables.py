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


def test_texts_are_rounded_with_a_dash_for_missing_numbers():
    assert TABLE.texts() == [["a|b", "0.333", "12,345"], ["c, d", "-", "7"]]
    assert TABLE.to_markdown() == (
        "| method | error [m] | voxels |\n"
        "| :--- | ---: | ---: |\n"
        "| a\\|b | 0.333 | 12,345 |\n"
        "| c, d | - | 7 |\n"
    )


def test_csv_has_full_precision():
    rows = list(csv.reader(io.StringIO(TABLE.to_csv())))
    assert rows[0] == ["method", "error [m]", "voxels"]
    assert float(rows[1][1]) == 1.0 / 3.0
    assert rows[2] == ["c, d", "", "7"]
    assert "\r" not in TABLE.to_csv()


def test_rows_of_the_wrong_length_are_rejected():
    with pytest.raises(InvalidInput, match="a row must have 1 cells, got 2"):
        Table([Column("a")], [["x", "y"]])
