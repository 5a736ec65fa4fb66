"""Trials: registrations of pairs with known truth, and their tables."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks._common.contenders import Cloud, Contender, pose_error
from benchmarks._common.results import Results
from scanlock.geometry.pose import Pose

COLUMNS = (
    "method", "solved", "median", "95th percentile", "wrong, called ok", "right, not called ok",
    "CPU ms",
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One registration: its errors, the claim of the method, and its CPU time [s]."""

    metres: float
    degrees: float
    claimed: bool | None
    seconds: float
    tolerance: tuple[float, float]

    @property
    def solved(self) -> bool:
        """Whether both errors are within the tolerance."""
        return self.metres <= self.tolerance[0] and self.degrees <= self.tolerance[1]


def run_trial(
    contender: Contender,
    source: Cloud,
    target: Cloud,
    truth: Pose,
    tolerance: tuple[float, float] = (0.3, 1.0),
) -> Trial:
    """Register without a start and return the errors and the CPU time."""
    begin = time.process_time()
    pose, claimed = contender.register(source, target, None)
    seconds = time.process_time() - begin
    return Trial(*pose_error(pose, truth), claimed, seconds, tolerance)


def trial_row(name: str, trials: Sequence[Trial]) -> list[str]:
    """Return the cells of `COLUMNS`."""
    metres, degrees = [one.metres for one in trials], [one.degrees for one in trials]
    return [
        name,
        f"{sum(one.solved for one in trials)} / {len(trials)}",
        f"{np.median(metres):.3f} m, {np.median(degrees):.3f}°",
        f"{np.percentile(metres, 95):.3f} m, {np.percentile(degrees, 95):.3f}°",
        _count([one.claimed and not one.solved for one in trials], trials),
        _count([one.solved and not one.claimed for one in trials], trials),
        f"{1e3 * np.median([one.seconds for one in trials]):.0f}",
    ]


def _count(cases: Sequence[bool | None], trials: Sequence[Trial]) -> str:
    return "-" if any(one.claimed is None for one in trials) else str(sum(map(bool, cases)))


def add_overview(results: Results, found: dict[str, dict[str, list[Trial]]], title: str) -> None:
    """Add the table of solved trials by group and method; `found` is by group, then by method."""
    methods = dict.fromkeys(name for by_name in found.values() for name in by_name)
    rows: list[list[str]] = []
    for group, by_name in found.items():
        cells = [group]
        for name in methods:
            trials = by_name.get(name, [])
            cells.append(f"{sum(one.solved for one in trials)} / {len(trials)}")
        rows.append(cells)
    results.add_table(("pairs", *methods), rows, title=title)
