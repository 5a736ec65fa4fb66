"""The scans of an experiment, one at a time, and what is true of them."""

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
from scanlock.io.sequences import ScanSequence, open_sequence
from scanlock.pipelines.study import StudyPair
from scanlock.simulation import SENSORS, SimulatedSequence, drive_through

TruthKind = Literal["exact", "given", "unknown"]
"""Where the poses of scans come from: the simulation, files beside the scans, or nowhere."""

_SAMPLE = 1 << 16
"""Bytes of each file that tell whether it is still the same."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ScanSeries:
    """Scans in their order.

    Attributes
    ----------
    title : str
        What they are, in a phrase.
    origin : str
        How to make or where to find the same ones; empty where the title says it.
    key : str
        What decides their points besides their names.
    names : tuple of str
    times : (n,) [s]
    load : callable
        Returns the (n, 3+) points [m] of a scan by its name, in the frame of its sensor.
    truth : tuple of Pose
        world_from_sensor of each scan; empty where it is unknown.
    truth_kind : str
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
                f"{len(self.names)} scans must have as many times and as many poses or none, got "
                f"{len(self.times)} and {len(self.truth)}"
            )

    def pairs(self, apart: int = 1) -> list[StudyPair]:
        """Return each scan with one some scans later: the earlier stays, the later moves.

        Raises
        ------
        InvalidInput
            There are no two scans so far apart.
        """
        require_count("apart", apart)
        if apart >= len(self.names):
            raise InvalidInput(f"apart must be below the {len(self.names)} scans, got {apart}")
        return [
            StudyPair(
                target=self.names[row],
                source=self.names[row + apart],
                truth=self.truth[row].inverse() @ self.truth[row + apart] if self.truth else None,
            )
            for row in range(len(self.names) - apart)
        ]

    def true_trajectory(self) -> list[Pose]:
        """Return first_from_scan of each scan; empty where it is unknown."""
        return [self.truth[0].inverse() @ pose for pose in self.truth]


def simulated_series(scene: str, sensor: str, *, every: int, scans: int, seed: int) -> ScanSeries:
    """Return scans along a drive through a simulated scene, made as they are asked for.

    They are those of ``scanlock simulate``: every point in the frame of the sensor in the middle
    of its sweep, in float32.

    Parameters
    ----------
    scene, sensor : str
        "street" or "forest"; a key of `SENSORS`.
    every : int
        Take every k-th sweep of the drive.
    scans : int
        How many to take; at least 2.
    seed : int
        Decides the scene, the drive and the noise.
    """
    require_count("every", every)
    require_count("scans", scans, least=2)
    place, drive = drive_through(scene, count=1 + (scans - 1) * every, seed=seed)
    sequence = SimulatedSequence(
        world=place.world, sensor=SENSORS[sensor](), drive=drive, seed=seed
    )
    taken = range(0, len(sequence), every)
    spoken = sensor.replace("_", "-")

    def load(name: str) -> ArrayLike:
        return sequence[int(name) * every].deskewed().astype(np.float32)

    return ScanSeries(
        title=f"{scans} simulated scans of an {spoken.upper()}, {which(every, 'sweep')} of a drive "
        f"through a {scene}",
        origin=f"scanlock simulate {scene} --sensor {spoken} --scans {scans} --every {every} "
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
    """Return every k-th scan of a folder, of which at most `scans` are taken.

    Parameters
    ----------
    folder : Path
        See `scanlock.io.sequences.open_sequence`.
    every : int
        Take every k-th scan.
    scans : int, optional
        How many to take at most; all by default.
    poses : Path, optional
        world_from_sensor of each scan of the folder, in place of its own.

    Raises
    ------
    InvalidInput
        Fewer than two scans are left.
    """
    require_count("every", every)
    if scans is not None:
        require_count("scans", scans, least=2)
    taken = open_sequence(folder, poses, every=every, count=scans)
    if len(taken) < 2:
        raise InvalidInput(
            f"{which(every)} of {folder} leaves {len(taken)}, and two are needed; take more of them"
        )
    kind = f"{folder.resolve().name} ({taken.title})"
    return series_of(taken, title=f"{len(taken)} scans, {which(every)} of {kind}")


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
        What decides how the files are read, where it is more than the files themselves.
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


def which(every: int, what: str = "scan") -> str:
    """Return "every scan", "every 2nd scan" and so on."""
    if every == 1:
        return f"every {what}"
    teens = every % 100 in (11, 12, 13)
    ending = "th" if teens else {1: "st", 2: "nd", 3: "rd"}.get(every % 10, "th")
    return f"every {every}{ending} {what}"


def _digest(sequence: ScanSequence) -> str:
    digest = hashlib.sha256()
    for path in sequence.paths:
        digest.update(f"{path.name} {path.stat().st_size}".encode())
        with path.open("rb") as handle:
            digest.update(handle.read(_SAMPLE))
    return digest.hexdigest()
