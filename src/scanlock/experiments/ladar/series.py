"""Simulated frames of a facet ladar on rugged terrain, at four speeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scanlock.arrays import Matrix, Points
from scanlock.errors import require_count
from scanlock.experiments.series import ScanSeries
from scanlock.geometry.pose import Pose
from scanlock.pipelines.study import StudyPair
from scanlock.simulation import (
    AHEAD_AND_DOWN,
    FacetLadar,
    LadarSequence,
    PanTiltMount,
    Scene,
    ladar_run,
    ranges_from_points,
    rugged,
)


@dataclass(frozen=True, kw_only=True, slots=True)
class LadarDrive:
    """Motion of a vehicle between two frames of its ladar."""

    name: str
    """Name of the drive, also in the names of frames."""

    speed: float
    """Speed along the path [m/s]."""

    step: int
    """Number of frames between the two scans of a pair."""

    def __str__(self) -> str:
        frames = "consecutive frames" if self.step == 1 else f"{self.step} frames apart"
        return f"{self.name}, {frames}"


PARKED = LadarDrive(name="parked", speed=1e-6, step=20)
CREEPING = LadarDrive(name="creeping", speed=0.05, step=1)
WALKING = LadarDrive(name="at a walk", speed=1.0, step=20)
DRIVING = LadarDrive(name="at 15 km/h", speed=15.0 / 3.6, step=1)

DRIVES = (CREEPING, PARKED, DRIVING, WALKING)
"""All drives. The paper states no speeds; the first two give its mean distances."""

_SEEDS = 1000
"""Difference between the terrain seeds of two experiments."""

_PLACES = 5
"""Number of places per terrain, evenly spaced on about 300 m, beyond the ladar's range."""


def ladar_series(places: int, seed: int) -> ScanSeries:
    """Return two frames of each of `DRIVES` at several places, in vehicle frames.

    Parameters
    ----------
    places : int
        Number of places, at least 1; five per terrain.
    seed : int
        Seed of terrains and noise.
    """
    require_count("places", places)
    require_count("seed", seed, minimum=0)
    frames: dict[str, Points] = {}
    poses: list[Pose] = []
    times: list[float] = []
    for place in range(places):
        for drive, run in zip(DRIVES, _runs(place, seed), strict=True):
            for index, name in zip((0, drive.step), frame_names(place, drive), strict=True):
                frame = run[index]
                frames[name] = frame.points.astype(np.float32).astype(np.float64)
                poses.append(frame.pose)
                times.append(frame.time)
    return ScanSeries(
        title=f"Pairs of frames of a simulated facet ladar at {places} places of rugged terrain",
        origin="",
        key=f"facet ladar seed {seed}",
        names=tuple(frames),
        times=np.array(times),
        load=frames.__getitem__,
        truth=tuple(poses),
        truth_kind="exact",
    )


def _runs(place: int, seed: int) -> list[LadarSequence]:
    """Return the frames of each drive at a place."""
    number = seed * _SEEDS + place
    scene = _terrain(number - place % _PLACES)
    start = scene.track.length * (place % _PLACES) / _PLACES
    return [
        ladar_run(number, scene=scene, start=start, speed=drive.speed, count=drive.step + 1)
        for drive in DRIVES
    ]


@lru_cache(maxsize=1)
def _terrain(number: int) -> Scene:
    """Return a terrain by its seed; the last one is cached, because it takes seconds."""
    return rugged(np.random.default_rng(number))


def frame_names(place: int, drive: LadarDrive) -> tuple[str, str]:
    """Return the names of the two frames of a drive at a place: target and source."""
    stem = f"place {place:02d} {drive.name} frame"
    return f"{stem} 0", f"{stem} {drive.step}"


def ladar_pairs(series: ScanSeries) -> list[StudyPair]:
    """Return the pair of each drive at each place, ordered by place."""
    truth = dict(zip(series.names, series.truth, strict=True))
    return [
        StudyPair(target=target, source=source, truth=truth[target].inverse() @ truth[source])
        for target, source in zip(series.names[::2], series.names[1::2], strict=True)
    ]


def pairs_of(drive: LadarDrive, pairs: Sequence[StudyPair]) -> list[StudyPair]:
    """Return the pairs of one drive, ordered by place."""
    return list(pairs[DRIVES.index(drive) :: len(DRIVES)])


def range_image(points: Points) -> Matrix:
    """Return the (32, 180) range image [m] of a frame; NaN without a return."""
    pan, tilt = AHEAD_AND_DOWN.at(0.0)
    return ranges_from_points(points, FacetLadar(), PanTiltMount(), pan=pan, tilt=tilt)
