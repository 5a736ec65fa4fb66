"""What came of registering many pairs, and the tables of it."""

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contenders import Cloud, Contender, pose_error
from scanlock.geometry.pose import Pose
from tables import print_table

HEADER = (
    "method", "solved", "median", "95th percentile", "claimed wrongly", "right, not claimed",
    "CPU ms",
)  # fmt: skip


@dataclass(frozen=True)
class Trial:
    """One registration: its errors, what was claimed, and what it cost."""

    metres: float
    degrees: float
    claimed: bool | None
    seconds: float
    tolerance: tuple[float, float]

    @property
    def solved(self) -> bool:
        return self.metres <= self.tolerance[0] and self.degrees <= self.tolerance[1]


def tried(
    contender: Contender,
    source: Cloud,
    target: Cloud,
    truth: Pose,
    tolerance: tuple[float, float] = (0.3, 1.0),
) -> Trial:
    begin = time.process_time()
    pose, claimed = contender.register(source, target, None)
    seconds = time.process_time() - begin
    return Trial(*pose_error(pose, truth), claimed, seconds, tolerance)


def row(name: str, trials: Sequence[Trial]) -> list[str]:
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


def print_overview(found: dict[str, dict[str, list[Trial]]]) -> None:
    """Print solved of all by method and group; `found` is by group, then by method."""
    methods = dict.fromkeys(name for by_name in found.values() for name in by_name)
    rows: list[list[str]] = []
    for group, by_name in found.items():
        cells = [group]
        for name in methods:
            trials = by_name.get(name, [])
            cells.append(f"{sum(one.solved for one in trials)} / {len(trials)}")
        rows.append(cells)
    print_table(("pairs", *methods), rows)
