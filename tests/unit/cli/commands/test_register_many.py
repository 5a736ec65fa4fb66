import csv
import json
from collections import Counter

import pytest

from scanlock.cli.app import _forwarded
from scanlock.cli.pair_progress import progress_text


@pytest.fixture
def table(scans, tmp_path):
    """A table of a good pair, a file that cannot be read, and two scenes."""
    lines = ["source,target,initial,place"]
    for source, target in (("source", "target"), ("cut", "target"), ("elsewhere", "target")):
        ending = "bin" if source == "cut" else "npy"
        lines.append(f"{scans / source}.{ending},{scans / target}.npy,,hall")
    path = tmp_path / "list.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def _rows(path):
    with path.open(newline="") as handle:
        return [{**row, "seconds": ""} for row in csv.DictReader(handle)]


def test_every_pair_becomes_a_row(scanlock, table, tmp_path):
    output = tmp_path / "rows.csv"
    done = scanlock("register", "--pairs", table, "-o", output, "--executor", "threads")
    assert (done.code, done.err) == (2, "")
    first, second, third = _rows(output)
    assert (first["status"], first["ok"], first["place"]) == ("ok", "true", "hall")
    assert (second["status"], second["error"]) == ("error", "FormatError")
    assert third["ok"] == "false"
    assert done.out.startswith("not all ok  1 of 3 pairs are verified")
    assert "1 x error: " in " ".join(done.out.split())
    assert f"wrote {output}" in done.out


def test_an_output_is_resumed_or_overwritten_but_never_by_surprise(scanlock, table, tmp_path):
    output = tmp_path / "rows.csv"
    words = ("register-many", table, "-o", output, "--executor", "threads")
    scanlock(*words)
    whole = _rows(output)
    refused = scanlock(*words)
    assert refused.code == 1
    assert "add --resume to register the pairs that it lacks, or --overwrite" in refused.err
    output.write_bytes(output.read_bytes()[:-40])
    assert scanlock(*words, "--resume").code == 2
    assert _rows(output) == whole
    done = scanlock(*words, "--resume")
    assert "time" not in done.out
    assert _rows(output) == whole
    scanlock(*words, "--overwrite")
    assert _rows(output) == whole
    assert scanlock(*words, "--overwrite", "--resume").code == 1


def test_json_lines_have_the_same_values(scanlock, table, tmp_path):
    for ending in ("csv", "jsonl"):
        output = tmp_path / f"rows.{ending}"
        scanlock("register-many", table, "-o", output, "--executor", "threads", "--method", "gicp")
    rows = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    for row, text in zip(rows, _rows(tmp_path / "rows.csv"), strict=True):
        assert row["name"] == text["name"]
        assert row["method"] == text["method"]
        assert row["x"] == (float(text["x"]) if text["x"] else None)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "rows.txt"), "the output must end in .csv, .jsonl"),
        (("-o", "missing/rows.csv"), "the folder missing of the output does not exist"),
        (("-o", "rows.csv", "--workers", "0"), "--workers must be a whole number"),
        (("-o", "rows.csv", "--set", "voxelsize=1"), "--set: voxelsize is not"),
    ],
)
def test_a_wrong_option_is_named(scanlock, table, tmp_path, monkeypatch, words, message):
    monkeypatch.chdir(tmp_path)
    done = scanlock("register", "--pairs", table, *words)
    assert done.code == 1
    assert message in done.err


def test_a_malformed_table_is_refused_before_the_first_pair(scanlock, tmp_path):
    table = tmp_path / "list.csv"
    table.write_text("source,target\na,b\na\n")
    done = scanlock("register", "--pairs", table, "-o", tmp_path / "rows.csv")
    assert done.code == 1
    assert "list.csv, line 3: expected 2 columns" in done.err
    assert not (tmp_path / "rows.csv").exists()


def test_an_interrupt_keeps_the_rows_and_names_the_remedy(scanlock, table, tmp_path, monkeypatch):
    from scanlock.pipelines.many.pair_row import PairRows
    from scanlock.pipelines.many.register_many import register_many

    def interrupted(*arguments, **options):
        rows = register_many(*arguments, **{**options, "executor": None, "workers": None})

        def two():
            yield next(rows)
            raise KeyboardInterrupt

        return PairRows(two())

    monkeypatch.setattr("scanlock.pipelines.many.register_many.register_many", interrupted)
    output = tmp_path / "rows.csv"
    done = scanlock("register", "--pairs", table, "-o", output)
    assert done.code == 130
    assert "has 1 of 3 rows, and the same command with --resume continues" in done.err
    assert len(_rows(output)) == 1


def test_register_with_a_table_is_the_command_for_many():
    assert _forwarded(["register", "--pairs", "a.csv", "-o", "b"]) == [
        "register-many", "a.csv", "-o", "b",
    ]  # fmt: skip
    assert _forwarded(["register", "-o", "b", "--pairs=a.csv"]) == [
        "register-many", "-o", "b", "a.csv",
    ]  # fmt: skip
    for words in (["register", "a", "b"], ["info", "--pairs", "a"], []):
        assert _forwarded(words) == words


def test_progress_has_the_rate_the_time_left_and_the_failures():
    counts = Counter({"ok": 70, "ambiguous": 20, "error": 10})
    assert progress_text(counts, 1000, 0, 50.0) == (
        "100/1,000, 2.0 pairs/s, 7:30 left, 20 not verified, 10 errors"
    )
    # Rows of an earlier run count as done, but not for the rate.
    assert progress_text(counts, 100_100, 50, 50.0) == (
        "100/100,100, 1.0 pairs/s, 27 h 46 min left, 20 not verified, 10 errors"
    )
    assert progress_text(Counter(), 5, 0, 0.0) == "0/5, 0 not verified"
