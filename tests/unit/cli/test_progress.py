import io

import pytest
from rich.console import Console

from scanlock.cli import progress as module
from scanlock.cli.progress import counts_text, progress, progress_counter, rate_text


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((95, 154, "scans", 21.4, "2 unverified"),
         "95/154 scans, 21 scans/s, 2 unverified, 0:00:03 left"),
        ((0, 154, "scans", None), "0/154 scans"),
        ((3, 9, "", 2.0), "3/9, 0:00:03 left"),
        ((3, None, "scans", 0.51), "3 scans, 0.5 scans/s"),
    ],
)  # fmt: skip
def test_counts_rate_and_remaining_time_are_in_words(arguments, text):
    assert counts_text(*arguments) == text


def test_small_rates_have_a_digit_more():
    assert rate_text(0.26, "scans") == "0.3 scans/s"
    assert rate_text(10.4, "scans") == "10 scans/s"


def test_without_a_terminal_nothing_is_shown(capsys):
    assert list(progress([1, 2], 2, "work")) == [1, 2]
    with progress_counter(2, "work", "scans") as counted:
        counted("remark")
    assert capsys.readouterr() == ("", "")


def test_the_bar_shows_the_counts_and_the_remark_in_eighty_columns(monkeypatch):
    terminal = Console(file=io.StringIO(), force_terminal=True, width=80, color_system=None)
    monkeypatch.setattr(module, "screen", lambda _: terminal)
    with progress_counter(154, "mapping", "scans", done=94) as counted:
        counted("2 unverified")
    shown = terminal.file.getvalue()
    assert "mapping" in shown
    assert "95/154 scans" in shown
    assert "2 unverified" in shown
