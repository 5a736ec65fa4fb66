"""Scans of an experiment, loaded one at a time, with their true poses."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from scanlock.arrays import Vector, frozen
from scanlock.errors import InvalidInput, require_count
from scanlock.geometry.pose import Pose
from scanlock.io.formats.stations import split_station
from scanlock.io.sequences.open_sequence import open_sequence
from scanlock.io.sequences.scan_sequence import ScanSequence
from scanlock.pipelines.study import StudyPair
from scanlock.simulation import SENSORS, SimulatedSequence, drive_through

TruthKind = Literal["exact", "given", "unknown"]
"""Origin of the true poses: simulation, files of the data set, or unknown."""

_SAMPLE = 1 << 16
"""Number of bytes of each file that enter the digest."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanSeries:
    """Sequence of scans.

    Attributes
    ----------
    title : str
        Phrase that describes the scans.
    origin : str
        Command or files that give the same scans; empty if the title suffices.
    key : str
        Identifier of the points, in addition to the names.
    names : tuple of str
        Unique names of the scans.
    times : (n,) [s]
        Times of the scans.
    load : callable
        Function from the name of a scan to its (n, 3+) points [m] in the sensor frame.
    truth : tuple of Pose
        True poses world_from_sensor of the scans; empty if unknown.
    truth_kind : str
        Origin of the true poses.
    """

    title: str
    origin: str
    key: str
    names: tuple[str, ...]
    times: Vector
    load: Callable[[str], ArrayLike]
    truth: tuple[Pose, ...] = ()
    truth_kind: TruthKind = "unknown"

    def __post_init__(self) -> None:
        frozen(self.times)
        if len(self.names) < 2:
            raise InvalidInput(f"an experiment needs at least 2 scans, got {len(self.names)}")
        if len(self.times) != len(self.names) or len(self.truth) not in (0, len(self.names)):
            raise InvalidInput(
                f"{len(self.names)} scans need as many times, and as many true poses or none, got "
                f"{len(self.times)} times and {len(self.truth)} poses"
            )

    def pairs(self, step: int = 1) -> list[StudyPair]:
        """Return the pairs of scans that are `step` scans apart; the earlier one is the target.

        Raises
        ------
        InvalidInput
            `step` is not below the number of scans.
        """
        require_count("step", step)
        if step >= len(self.names):
            raise InvalidInput(f"step must be below the {len(self.names)} scans, got {step}")
        return [
            StudyPair(
                target=self.names[row],
                source=self.names[row + step],
                truth=self.truth[row].inverse() @ self.truth[row + step] if self.truth else None,
            )
            for row in range(len(self.names) - step)
        ]

    def true_trajectory(self) -> list[Pose]:
        """Return the true poses first_from_scan of all scans; empty if unknown."""
        return [self.truth[0].inverse() @ pose for pose in self.truth]


def simulated_series(scene: str, sensor: str, *, every: int, scans: int, seed: int) -> ScanSeries:
    """Return scans along a drive through a simulated scene, computed on demand.

    The scans equal those of ``scanlock simulate``: deskewed to the middle of the sweep, float32.

    Parameters
    ----------
    scene : str
        "street" or "forest".
    sensor : str
        Key of `SENSORS`.
    every : int
        Stride over the sweeps of the drive.
    scans : int
        Number of scans; at least 2.
    seed : int
        Seed of the scene, the drive and the noise.
    """
    require_count("every", every)
    require_count("scans", scans, minimum=2)
    place, drive = drive_through(scene, count=1 + (scans - 1) * every, seed=seed)
    sequence = SimulatedSequence(
        world=place.world, sensor=SENSORS[sensor](), drive=drive, seed=seed
    )
    taken = range(0, len(sequence), every)
    sensor_name = sensor.replace("_", "-")

    def load(name: str) -> ArrayLike:
        return sequence[int(name) * every].deskewed().astype(np.float32)

    return ScanSeries(
        title=f"{scans} simulated scans of an {sensor_name.upper()}, "
        f"{ordinal_phrase(every, 'sweep')} of a drive through a {scene}",
        origin=f"scanlock simulate {scene} --sensor {sensor_name} --scans {scans} --every {every} "
        f"--seed {seed}",
        key=f"{scene} {sensor} every {every} seed {seed}",
        names=tuple(f"{number:06d}" for number in range(scans)),
        times=drive.times[::every].copy(),
        load=load,
        truth=tuple(drive.poses[index] for index in taken),
        truth_kind="exact",
    )


def recorded_series(
    folder: Path, *, every: int, scans: int | None = None, poses: Path | None = None
) -> ScanSeries:
    """Return every k-th scan of a folder.

    Parameters
    ----------
    folder : Path
        See `scanlock.io.open_sequence`.
    every : int
        Stride over the scans of the folder.
    scans : int, optional
        Maximum number of scans; all by default.
    poses : Path, optional
        Poses world_from_sensor of all scans of the folder, instead of its own.

    Raises
    ------
    InvalidInput
        Fewer than two scans remain.
    """
    require_count("every", every)
    if scans is not None:
        require_count("scans", scans, minimum=2)
    taken = open_sequence(folder, poses, every=every, count=scans)
    if len(taken) < 2:
        raise InvalidInput(
            f"{ordinal_phrase(every)} of {folder} gives {len(taken)} scans, at least 2 needed; "
            "reduce the stride"
        )
    kind = f"{folder.resolve().name} ({taken.title})"
    return series_of(taken, title=f"{len(taken)} scans, {ordinal_phrase(every)} of {kind}")


def series_of(
    sequence: ScanSequence, *, title: str, origin: str = "", variant: str = ""
) -> ScanSeries:
    """Return the scans of a sequence as a series.

    Parameters
    ----------
    sequence : ScanSequence
    title, origin : str
        See `ScanSeries`.
    variant : str
        Options of the reader that change the points of the same files.
    """
    names = sequence.names
    if len(set(names)) < len(names):
        names = tuple(f"{path.parent.name}/{path.stem}" for path in sequence.paths)
    rows = {name: row for row, name in enumerate(names)}
    return ScanSeries(
        title=title,
        origin=origin,
        key=f"{_digest(sequence)} {variant}",
        names=names,
        times=sequence.times.copy(),
        load=lambda name: sequence.scan(rows[name]),
        truth=sequence.poses,
        truth_kind="given" if sequence.poses else "unknown",
    )


def ordinal_phrase(every: int, noun: str = "scan") -> str:
    """Return a phrase such as "every scan" or "every 2nd scan"."""
    if every == 1:
        return f"every {noun}"
    teens = every % 100 in (11, 12, 13)
    ending = "th" if teens else {1: "st", 2: "nd", 3: "rd"}.get(every % 10, "th")
    return f"every {every}{ending} {noun}"


def _digest(sequence: ScanSequence) -> str:
    digest = hashlib.sha256()
    for path in sequence.paths:
        file = split_station(path)[0]
        digest.update(f"{path.name} {file.stat().st_size}".encode())
        with file.open("rb") as handle:
            digest.update(handle.read(_SAMPLE))
    return digest.hexdigest()
