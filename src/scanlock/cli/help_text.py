"""Layout of the help: names in one column, wrapped descriptions in another."""

import io
import textwrap
from typing import TYPE_CHECKING, Any

from cyclopts.help import PlainFormatter

if TYPE_CHECKING:
    from cyclopts.help import HelpEntry, HelpPanel
    from rich.console import Console, ConsoleOptions

_MAX_WIDTH = 100
_MAX_NAMES = 30
"""Maximum width of the column of names; longer ones have a line of their own."""

_INDENT = "  "


class ColumnFormatter(PlainFormatter):
    """Help in two columns, without the line breaks of the source code."""

    def __call__(self, console: "Console", options: "ConsoleOptions", panel: "HelpPanel") -> None:
        """Print one panel: parameters of a group, or commands."""
        if not panel.entries:
            return
        rows = [(_names(entry), _description(entry)) for entry in panel.entries]
        column = max((len(name) for name, _ in rows if len(name) <= _MAX_NAMES), default=0)
        width = max(min(console.width, _MAX_WIDTH) - column - 2 * len(_INDENT), 20)
        if panel.title:
            _print(console, f"{_text(panel.title)}:")
        for name, description in rows:
            lines = textwrap.wrap(description, width, break_on_hyphens=False) or [""]
            if len(name) > column:
                _print(console, f"{_INDENT}{name}")
                name = ""
            for line in lines:
                _print(console, f"{_INDENT}{name:{column}}{_INDENT}{line}".rstrip())
                name = ""
        console.print()


def _names(entry: "HelpEntry") -> str:
    """Return the names of an entry with the kind of value: ``-o, --output PATH``."""
    if entry.positional_label:
        return entry.positional_label
    names = [*entry.positive_shorts, *entry.positive_names, *entry.negative_names]
    return ", ".join(names) + (f" {entry.metavar}" if entry.metavar else "")


def _description(entry: "HelpEntry") -> str:
    """Return the description of an entry with its choices and default."""
    parts = [_text(entry.description)]
    if entry.choices:
        parts.append(f"[{' | '.join(entry.choices)}]")
    if entry.default is not None:
        parts.append(f"[default: {entry.default}]")
    return " ".join(part for part in parts if part)


def _text(content: Any) -> str:
    """Return the words of a text or a Rich renderable, without its line breaks."""
    if content is None:
        return ""
    if isinstance(content, str):
        return " ".join(content.split())
    from rich.console import Console

    out = io.StringIO()
    Console(file=out, width=10_000, markup=False, highlight=False, emoji=False).print(content)
    return " ".join(out.getvalue().split())


def _print(console: "Console", line: str) -> None:
    console.print(line, highlight=False, markup=False, emoji=False, soft_wrap=True)
