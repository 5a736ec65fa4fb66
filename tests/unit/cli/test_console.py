import json

import numpy as np
import pytest

from scanlock.cli.console import (
    counting,
    print_facts,
    print_json,
    print_line,
    print_status,
    print_table,
    waiting,
)


def test_facts_are_two_columns_wrapped_between_words(capsys):
    print_facts([("name", "word " * 40), ("longer name", "[a] 1.5\n    as it is")])
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith("  name         word word")
    assert all(line.startswith(" " * 15 + "word") for line in lines[1:-2])
    assert " ".join(lines).count("word") == 40
    assert lines[-2:] == ["  longer name  [a] 1.5", " " * 15 + "    as it is"]


def test_a_path_is_never_wrapped(capsys):
    path = "/a-b" * 60
    print_facts([("path", path)])
    print_line(path)
    lines = capsys.readouterr().out.splitlines()
    assert [line.strip().removeprefix("path").strip() for line in lines] == [path, path]


def test_tables_are_right_aligned(capsys):
    print_table(["a", "long head"], [["1", "2"], ["10", "20"]])
    assert capsys.readouterr().out == "   a  long head\n   1          2\n  10         20\n"


def test_json_has_full_precision(capsys):
    values = np.random.default_rng(0).normal(size=50).tolist()
    print_json({"values": values})
    assert json.loads(capsys.readouterr().out) == {"values": values}


def test_there_is_no_colour_and_no_progress_without_a_terminal(capsys):
    print_status("ok", "text", good=True)
    with waiting("a while"):
        assert list(counting([1, 2, 3], "things")) == [1, 2, 3]
    assert capsys.readouterr() == ("ok  text\n", "")


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)


@pytest.mark.parametrize(("good", "colour"), [(True, "32m"), (False, "31m")])
def test_the_status_is_coloured_on_a_terminal(terminal, capsys, good, colour):
    print_status("status", "text", good=good)
    assert colour in capsys.readouterr().out


def test_no_color_disables_colours(terminal, monkeypatch, capsys):
    monkeypatch.setenv("NO_COLOR", "1")
    print_status("ok", "text", good=True)
    assert "32m" not in capsys.readouterr().out


def test_progress_is_printed_to_stderr_of_a_terminal(terminal, capsys):
    with waiting("a while"):
        assert list(counting([1, 2, 3], "things")) == [1, 2, 3]
    out, err = capsys.readouterr()
    assert out == ""
    assert "things" in err
