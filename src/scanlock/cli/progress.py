"""A bar at the terminal for work of a known length that hands out its results one by one."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from scanlock.cli.console import screen

_Item = TypeVar("_Item")


def progress(items: Iterable[_Item], count: int, what: str, /) -> Iterator[_Item]:
    """Yield items while a bar at a terminal, on stderr, shows how many of `count` are done."""
    from rich.progress import track

    console = screen("stderr")
    yield from track(
        items, what, total=count, console=console, transient=True, disable=not console.is_terminal
    )
