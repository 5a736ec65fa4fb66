"""Scan files in temporal order, with times, numbers and poses."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen
from scanlock.errors import require_count
from scanlock.geometry.pose import Pose
from scanlock.io.formats.stations import split_station

Loader = Callable[[Path], Points]
"""Function that returns the (n, 3) points [m] of a file, without rows at (0, 0, 0)."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanSequence:
    """Scan files in temporal order, with times and poses; points are read on request.

    Attributes
    ----------
    title : str
        Kind of the folder.
    paths : tuple of Path
        File of each scan.
    times : (n,) [s]
        Time of each scan; its number where the folder has no times.
    poses : tuple of Pose
        ``world_from_sensor`` of each scan; empty where the folder has no poses.
    load : callable
        Function that returns the (n, 3) points [m] of a file, without rows at (0, 0, 0).
    numbers : (n,)
        Number of each scan, from 0: its row in the times and poses of KITTI, else among all scans
        of the folder; 0, 1, 2, ... by default.
    missing_poses : str
        Reason why there are no poses, with a remedy; empty where it is not known.
    """

    title: str
    paths: tuple[Path, ...]
    times: Vector
    poses: tuple[Pose, ...]
    load: Loader
    numbers: Labels = field(default_factory=lambda: np.empty(0, np.int64))
    missing_poses: str = ""

    def __post_init__(self) -> None:
        if len(self.numbers) == 0:
            object.__setattr__(self, "numbers", np.arange(len(self.paths)))
        frozen(self.times)
        frozen(self.numbers)

    def __len__(self) -> int:
        return len(self.paths)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each scan: that of its file without the extension, and ``#`` with a station."""
        return tuple(map(_name, self.paths))

    def scan(self, index: int) -> Points:
        """Read the (n, 3) points [m] of a scan."""
        return self.load(self.paths[index])

    def subsampled(self, every: int, count: int | None = None) -> "ScanSequence":
        """Return every k-th scan from the first on, at most `count` of them.

        Raises
        ------
        InvalidInput
            An `every` below one.
        """
        require_count("every", every)
        rows = range(0, len(self), every)[:count]
        taken = np.array(rows, np.int64)
        return replace(
            self,
            paths=tuple(self.paths[row] for row in rows),
            times=self.times[taken],
            numbers=self.numbers[taken],
            poses=tuple(self.poses[row] for row in rows) if self.poses else (),
        )


def _name(path: Path) -> str:
    file, station = split_station(path)
    return file.stem if station is None else f"{file.stem}#{station}"
