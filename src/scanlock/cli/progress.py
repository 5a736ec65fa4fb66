"""Progress bar for work of known length that yields its results one by one."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

from scanlock.cli.console import screen

_Item = TypeVar("_Item")


def progress(items: Iterable[_Item], count: int, title: str, /) -> Iterator[_Item]:
    """Yield items with a progress bar of `count` steps on stderr at a terminal."""
    from rich.progress import track

    console = screen("stderr")
    yield from track(
        items, title, total=count, console=console, transient=True, disable=not console.is_terminal
    )
