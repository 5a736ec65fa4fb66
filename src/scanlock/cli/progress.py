"""Progress bars for work of known length: counts, rate and remaining time."""

import math
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from datetime import timedelta
from typing import TYPE_CHECKING, Protocol, TypeVar

from scanlock.cli.console import screen

if TYPE_CHECKING:
    from rich.progress import Progress

_Item = TypeVar("_Item")


class Counter(Protocol):
    """Counter of finished items."""

    def __call__(self, remark: str = "") -> None:
        """Count one more item, with a remark on all items so far."""
        ...


def progress(items: Iterable[_Item], count: int, title: str, /) -> Iterator[_Item]:
    """Yield items with a progress bar of `count` steps on stderr at a terminal."""
    with progress_counter(count, title) as counted:
        for item in items:
            yield item
            counted()


@contextmanager
def progress_counter(
    count: int, title: str, unit: str = "", *, done: int = 0
) -> Generator[Counter]:
    """Show a progress bar on stderr at a terminal, and yield a function to call after each item.

    The bar shows, for example, ``95/154 scans, 21 scans/s, 2 unverified, 0:00:03 left``.

    Parameters
    ----------
    count : int
        Number of items.
    title : str
        Text in front of the bar.
    unit : str
        Plural of the items.
    done : int
        Number of items that are finished already.
    """
    console = screen("stderr")
    if not console.is_terminal:
        yield _count_nothing
        return
    bar = _bar(unit)
    with bar:
        task = bar.add_task(title, total=count, completed=done, remark="")
        yield lambda remark="": bar.update(task, advance=1, remark=remark)


def counts_text(
    done: float, total: float | None, unit: str, speed: float | None, remark: str = ""
) -> str:
    """Return counts, rate and remaining time in words.

    Parameters
    ----------
    done, total : float
        Numbers of items; `total` is None where it is unknown.
    unit : str
        Plural of the items; empty for none.
    speed : float [1/s] or None
        Items per second, where known.
    remark : str
        Remark on the items so far; empty for none.
    """
    of = f"{done:.0f}" if total is None else f"{done:.0f}/{total:.0f}"
    parts = [f"{of} {unit}".rstrip(), rate_text(speed, unit) if unit and speed else "", remark]
    if speed and total is not None:
        parts.append(f"{timedelta(seconds=math.ceil((total - done) / speed))} left")
    return ", ".join(part for part in parts if part)


def rate_text(speed: float, unit: str) -> str:
    """Return a rate such as ``21 scans/s``; with a digit after the point if it is small."""
    return f"{speed:.0f} {unit}/s" if speed >= 10.0 else f"{speed:.1f} {unit}/s"


def _bar(unit: str) -> "Progress":
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    class Counts(ProgressColumn):
        def render(self, task: Task) -> Text:
            remark = str(task.fields["remark"])
            return Text(counts_text(task.completed, task.total, unit, task.speed, remark))

    title = TextColumn("{task.description}")
    return Progress(
        title, BarColumn(bar_width=14), Counts(), console=screen("stderr"), transient=True
    )


def _count_nothing(remark: str = "") -> None:
    pass
