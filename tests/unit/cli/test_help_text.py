"""Layout of the help."""

from itertools import pairwise

import pytest


@pytest.mark.parametrize("width", [80, 100, 140])
def test_help_is_wrapped_once_in_two_columns(scanlock, monkeypatch, width):
    monkeypatch.setenv("COLUMNS", str(width))
    lines = scanlock("register", "--help").out.splitlines()
    assert max(map(len, lines)) <= min(width, 100)
    [start] = [k for k, line in enumerate(lines) if line.startswith("  --dof CHOICE")]
    column = lines[start].index("Degrees of freedom")
    block = [lines[start]]
    while lines[start + len(block)].startswith(" " * column):
        block.append(lines[start + len(block)])
    text = " ".join(line[column:].strip() for line in block)
    assert "planar motion (xy+yaw). The others keep the initial pose." in text
    # Every line but the last has no room for the first word of the next.
    room = min(width, 100) - column
    for line, following in pairwise(block):
        assert len(line[column:]) + 1 + len(following.split()[0]) > room


def test_choices_and_defaults_are_listed(scanlock):
    words = " ".join(scanlock("register", "--help").out.split())
    assert "[xyz+rpy | xyz+yaw | xy+yaw] [default: xyz+rpy]" in words
    assert "-o, --output PATH" in words


def test_every_command_is_listed(scanlock):
    from scanlock.cli.command_table import COMMANDS

    out = scanlock("--help").out
    for name, command in COMMANDS.items():
        assert f"  {name} " in out
        assert command.help.split()[0] in out
