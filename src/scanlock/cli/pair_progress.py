"""Progress over a list of pairs: done, rate, time left and failures so far."""

import sys
import time
from collections import Counter
from collections.abc import Callable, Generator
from contextlib import contextmanager

from scanlock.cli.console import screen

_LINE_SECONDS = 60.0
"""Time between the lines of progress without a terminal [s]."""


@contextmanager
def pair_progress(total: int, counts: Counter[str]) -> Generator[Callable[[], None]]:
    """Show progress on stderr: a bar at a terminal, else a line a minute.

    Parameters
    ----------
    total : int
        Number of pairs.
    counts : Counter
        Number of rows by status, kept up to date by the caller.

    Yields
    ------
    callable
        To be called after each row.
    """
    begin, first = time.perf_counter(), counts.total()

    def text() -> str:
        return progress_text(counts, total, first, time.perf_counter() - begin)

    if not screen("stderr").is_terminal:
        yield _lines(text)
        return
    from rich.progress import BarColumn, Progress, TextColumn

    columns = TextColumn("pairs"), BarColumn(), TextColumn("{task.description}")
    with Progress(*columns, console=screen("stderr"), transient=True) as bar:
        task = bar.add_task(text(), total=total, completed=first)
        yield lambda: bar.update(task, description=text(), completed=counts.total())


def progress_text(counts: Counter[str], total: int, first: int, seconds: float) -> str:
    """Return done and total, the rate, the time left and the number of failures.

    Parameters
    ----------
    counts : Counter
        Number of rows by status.
    total : int
        Number of pairs.
    first : int
        Number of rows that an earlier run wrote.
    seconds : float
        Time since the start of this run [s].
    """
    done = counts.total()
    parts = [f"{done:,}/{total:,}"]
    if done > first and seconds > 0.0:
        rate = (done - first) / seconds
        parts += [f"{rate:.1f} pairs/s", f"{_duration((total - done) / rate)} left"]
    errors = counts["error"]
    parts.append(f"{done - counts['ok'] - errors:,} not verified")
    if errors:
        parts.append(f"{errors:,} errors")
    return ", ".join(parts)


def _lines(text: Callable[[], str]) -> Callable[[], None]:
    last = time.perf_counter()

    def advance() -> None:
        nonlocal last
        if time.perf_counter() - last >= _LINE_SECONDS:
            last = time.perf_counter()
            sys.stderr.write(text() + "\n")

    return advance


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes}:{rest:02}"
