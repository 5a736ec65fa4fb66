"""Clocks for a comparison: contenders run alternately in one process, after warm-up."""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

_Task = TypeVar("_Task")
_Outcome = TypeVar("_Outcome")


@dataclass(frozen=True)
class Lap(Generic[_Task, _Outcome]):
    """One run: its task, its outcome, and its CPU and wall time [s]."""

    task: _Task
    outcome: _Outcome
    cpu: float
    wall: float


def run_interleaved(
    runs: Mapping[str, Callable[[_Task], _Outcome]],
    tasks: Sequence[_Task],
    rounds: int,
    seconds: float,
) -> dict[str, list[Lap[_Task, _Outcome]]]:
    """Run every contender on every task, one after the other, `rounds` times.

    Two runs precede the clock. The second one estimates the duration: a contender that needs more
    than `seconds` in total gets fewer rounds, evenly spaced, and one at least.
    """
    counts: dict[str, int] = {}
    for name, run in runs.items():
        run(tasks[0])
        expected = lap(run, tasks[0]).wall * len(tasks)
        counts[name] = max(1, min(rounds, math.floor(seconds / expected)))
    found: dict[str, list[Lap[_Task, _Outcome]]] = {name: [] for name in runs}
    for number in range(rounds):
        for task in tasks:
            for name, run in runs.items():
                if (number + 1) * counts[name] // rounds > number * counts[name] // rounds:
                    found[name].append(lap(run, task))
    return found


def lap(run: Callable[[_Task], _Outcome], task: _Task) -> Lap[_Task, _Outcome]:
    """Return one timed run."""
    wall, cpu = time.perf_counter(), time.process_time()
    outcome = run(task)
    return Lap(task, outcome, time.process_time() - cpu, time.perf_counter() - wall)


def quartiles(values: Sequence[float], scale: float = 1.0) -> str:
    """Return the median, followed by the quartiles in brackets."""
    low, median, high = (scale * value for value in np.percentile(values, (25, 50, 75)))
    digits = 0 if median >= 100.0 else 1
    return f"{median:.{digits}f} ({low:.{digits}f}-{high:.{digits}f})"
