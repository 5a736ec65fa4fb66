import csv
import json

import pytest

from scanlock import FormatError, InvalidInput, Pair, PairRow
from scanlock.pipelines.many.pair import pair_of
from scanlock.pipelines.many.row_file import RowFile, finished_rows

_PAIRS = [
    pair_of(Pair(source=f"s{k}.bin", target="t.bin", extra={"place": f'"Hall", {k}\n'}), k)
    for k in range(4)
]


def _row(number, **values):
    pair = _PAIRS[number]
    common = {"name": pair.name, "source": pair.source, "target": pair.target}
    return PairRow(**common, **{"status": "ok", "reason": "a, b", **values}, extra=pair.extra)


_ROWS = [
    _row(0, probability=0.1 + 0.2, method="auto", pose=(0.1,) * 6 + (1.0,), notes=("one", "two")),
    _row(1, status="error", reason='a "quoted" one', error="FormatError"),
    _row(2, deviations=(1e-3,) * 6),
    _row(3, status="ambiguous", overlap=0.25),
]


def _write(path, rows, *, append=False):
    with RowFile(path, ["place"], append=append) as file:
        for row in rows:
            file.append(row)


def test_csv_keeps_every_digit_and_leaves_unknown_numbers_empty(tmp_path):
    path = tmp_path / "rows.csv"
    _write(path, _ROWS)
    with path.open(newline="") as handle:
        first, second, third, _ = csv.DictReader(handle)
    assert float(first["probability"]) == 0.1 + 0.2
    assert (first["ok"], second["ok"]) == ("true", "false")
    assert (second["reason"], second["x"]) == ('a "quoted" one', "")
    assert float(third["sigma_yaw"]) == 1e-3
    assert first["place"] == '"Hall", 0'
    assert first["notes"] == "one; two"
    assert len(path.read_text().splitlines()) == 5


def test_json_lines_hold_the_dictionaries(tmp_path):
    path = tmp_path / "rows.jsonl"
    _write(path, _ROWS)
    found = [json.loads(line) for line in path.read_text().splitlines()]
    assert found == [row.as_dict() | {"place": f'"Hall", {k}'} for k, row in enumerate(_ROWS)]


@pytest.mark.parametrize("ending", ["csv", "jsonl"])
def test_a_file_cut_short_resumes_to_the_same_bytes(tmp_path, ending):
    whole, path = tmp_path / f"whole.{ending}", tmp_path / f"cut.{ending}"
    _write(whole, _ROWS)
    data = whole.read_bytes()
    breaks = [k for k, byte in enumerate(data) if byte == ord("\n")]
    for end in sorted({*range(0, len(data), 23), *breaks, *(k + 1 for k in breaks)}):
        path.write_bytes(data[:end])
        rest = iter(_PAIRS)
        statuses = list(finished_rows(path, rest, "auto"))
        assert statuses == [row.status for row in _ROWS[: len(statuses)]]
        left = [int(pair.source[1]) for pair in rest]
        assert left == list(range(len(statuses), len(_ROWS)))
        _write(path, [_ROWS[k] for k in left], append=True)
        assert path.read_bytes() == data


def test_rows_of_another_list_or_method_are_refused(tmp_path):
    path = tmp_path / "rows.csv"
    _write(path, _ROWS)
    with pytest.raises(InvalidInput, match=r"row 1 \(s0 t\) is not that of pair 1"):
        list(finished_rows(path, iter(_PAIRS[1:]), "auto"))
    with pytest.raises(InvalidInput, match=r"row 3 \(s2 t\) is not that of pair 3"):
        list(finished_rows(path, iter(_PAIRS[:2]), "auto"))
    with pytest.raises(InvalidInput, match="of the method auto, not gicp"):
        list(finished_rows(path, iter(_PAIRS), "gicp"))


@pytest.mark.parametrize(("ending", "text"), [("csv", "x,y\n1,2\n"), ("jsonl", "no rows\n")])
def test_another_file_is_refused(tmp_path, ending, text):
    path = tmp_path / f"rows.{ending}"
    path.write_text(text)
    with pytest.raises(FormatError, match="expected rows of scanlock register-many"):
        list(finished_rows(path, iter(_PAIRS), "auto"))
