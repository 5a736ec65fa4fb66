"""Printing: facts and tables as text, or JSON."""

import json
import sys
import textwrap
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Literal, NoReturn, TypeVar

if TYPE_CHECKING:
    from rich.console import Console

_Item = TypeVar("_Item")

_MAX_WIDTH = 100
"""Maximum width of wrapped text, however wide the terminal."""

_INDENT = "  "

Facts = list[tuple[str, str]]
"""Names and values; a value may have several lines."""


def screen(stream: Literal["stdout", "stderr"] = "stdout") -> "Console":
    """Return a console that colours terminals only, unless NO_COLOR is set.

    Brackets and numbers are printed as they are, since paths contain them.
    """
    from rich.console import Console

    class Screen(Console):
        def on_broken_pipe(self) -> NoReturn:
            raise BrokenPipeError

    return Screen(
        stderr=stream == "stderr", highlight=False, markup=False, emoji=False, soft_wrap=True
    )


def print_status(status: str, text: str, *, good: bool) -> None:
    """Print a status in colour, with its subject."""
    from rich.text import Text

    screen().print(Text.assemble((status, "bold green" if good else "bold red"), _INDENT, text))


def print_title(text: str) -> None:
    """Print a title in bold."""
    screen().print(text, style="bold")


def print_facts(facts: Facts) -> None:
    """Print names and values in two columns, wrapped at words."""
    from rich.text import Text

    out = screen()
    column = max(len(name) for name, _ in facts)
    room = min(out.width, _MAX_WIDTH) - column - 2 * len(_INDENT)
    for name, value in facts:
        for line in _wrapped(value, room):
            out.print(Text.assemble(_INDENT, (f"{name:{column}}", "bold"), _INDENT, line))
            name = ""


def print_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print right-aligned columns under their headings."""
    from rich.text import Text

    table = [heads, *rows]
    widths = [max(len(row[k]) for row in table) for k in range(len(heads))]
    out = screen()
    for number, row in enumerate(table):
        cells = (f"{cell:>{width}}" for cell, width in zip(row, widths, strict=True))
        out.print(Text(_INDENT + _INDENT.join(cells), style="" if number else "bold"))


def print_line(text: str) -> None:
    """Print one line without wrapping, since it may contain a path to copy."""
    screen().print(text)


def print_json(content: Mapping[str, Any]) -> None:
    """Print JSON and nothing else; numbers keep every digit."""
    sys.stdout.write(json.dumps(content, indent=2, allow_nan=False) + "\n")


@contextmanager
def waiting(text: str) -> Generator[None]:
    """Show a spinner on stderr at a terminal, removed at the end."""
    console = screen("stderr")
    if not console.is_terminal:
        yield
        return
    with console.status(text):
        yield


def counting(items: Sequence[_Item], unit: str) -> Iterator[_Item]:
    """Yield items with a progress bar on stderr at a terminal."""
    from rich.progress import track

    console = screen("stderr")
    yield from track(items, unit, console=console, transient=True, disable=not console.is_terminal)


def _wrapped(value: str, room: int) -> list[str]:
    lines: list[str] = []
    for line in value.split("\n"):
        if len(line) <= room:
            lines.append(line)
            continue
        lines.extend(
            textwrap.wrap(line, max(room, 20), break_long_words=False, break_on_hyphens=False)
        )
    return lines
