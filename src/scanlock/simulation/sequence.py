"""Simulated sequences of scans along a drive, and pairs of scans with their exact pose."""

import functools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from scanlock.arrays import short_repr
from scanlock.errors import InvalidInput, require_count
from scanlock.geometry.pose import Pose
from scanlock.simulation.drive import Drive
from scanlock.simulation.scan import SimulatedScan, simulate_scan
from scanlock.simulation.scenes.forests import forest, forest_walk
from scanlock.simulation.scenes.rugged import rugged, rugged_drive
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.streets import street, street_drive
from scanlock.simulation.sensor_models import SENSORS
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.world import World

_Maker = TypeVar("_Maker")

SCENES = {"street": street, "forest": forest, "rugged": rugged}
"""Functions that generate the scenes, by name."""

_DRIVES = {"street": street_drive, "forest": forest_walk, "rugged": rugged_drive}
"""Functions that generate a drive through each scene."""


def drive_through(scene: str, *, count: int, seed: int) -> tuple[Scene, Drive]:
    """Generate a scene and a drive of `count` sweeps through it.

    Parameters
    ----------
    scene : str
        A key of `SCENES`.
    count : int
        Number of sweeps.
    seed : int
        Seed of the scene and the drive.

    Returns
    -------
    Scene
    Drive
        Poses of the sensor, one per sweep.

    Raises
    ------
    InvalidInput
        An unknown scene, a count below one, or a negative seed.
    """
    require_count("seed", seed, minimum=0)
    make = _named("scene", scene, SCENES)
    scene_rng, drive_rng = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    generated = make(scene_rng)
    return generated, _DRIVES[scene](generated, drive_rng, count=count)


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SimulatedSequence:
    """Scans of a sensor along a drive, simulated on access.

    Scan k depends only on the seed and on k, not on which scans were simulated before.

    Attributes
    ----------
    world : World
    sensor : Sensor
    drive : Drive
    seed : int
        Seed of range noise and lost returns.
    """

    world: World
    sensor: Sensor
    drive: Drive
    seed: int

    def __post_init__(self) -> None:
        require_count("seed", self.seed, minimum=0)

    def __len__(self) -> int:
        return len(self.drive)

    def __getitem__(self, index: int) -> SimulatedScan:
        """Simulate scan `index`; negative indices count from the end."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"scan {index} of a sequence of {len(self)}")
        k = index % len(self)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(k,)))
        return simulate_scan(
            self.world,
            self.sensor,
            self.drive.poses[k],
            rng,
            time=float(self.drive.times[k]),
            twist=self.drive.twists[k],
        )

    def __iter__(self) -> Iterator[SimulatedScan]:
        return self.scans(range(len(self)))

    def scans(self, indices: Iterable[int]) -> Iterator[SimulatedScan]:
        """Yield the scans of some indices, such as ``range(0, len(sequence), 10)``."""
        return (self[index] for index in indices)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedPair:
    """Two scans of one world by a sensor at rest, and the exact pose between them.

    Attributes
    ----------
    target, source : SimulatedScan
    target_from_source : Pose
    """

    target: SimulatedScan
    source: SimulatedScan
    target_from_source: Pose

    __repr__ = short_repr


def scan_pair(
    scene: str | Scene,
    sensor: str | Sensor,
    seed: int,
    *,
    baseline: tuple[float, float] = (3.0, 5.0),
    turn: float = np.radians(15.0),
) -> SimulatedPair:
    """Simulate two scans a few metres apart, at a random position of a scene.

    Parameters
    ----------
    scene : str or Scene
        "street", "forest" or "rugged", generated from the seed; or a given scene.
    sensor : str or Sensor
        A key of `SENSORS`, such as "hdl_64e", or a custom sensor.
    seed : int
        Seed of the scene (if it is given by name), the positions and the noise.
    baseline : (2,) [m]
        Minimum and maximum distance along the track between the scans.
    turn : float [rad]
        Maximum difference of their headings.

    Returns
    -------
    SimulatedPair
        Target, source and the exact pose between them.

    Raises
    ------
    InvalidInput
        An unknown name, a negative seed, or a baseline that is negative or descending.
    """
    require_count("seed", seed, minimum=0)
    if not 0.0 <= baseline[0] <= baseline[1]:
        raise InvalidInput(f"baseline must be 0 <= minimum <= maximum, got {baseline} m")
    if isinstance(sensor, str):
        sensor = _named("sensor", sensor, SENSORS)()
    if isinstance(scene, str):
        scene = _generated(scene, seed)
    _, rng, *noise = _streams(seed)
    along = rng.uniform(0.0, scene.track.length)
    beyond = along + rng.uniform(*baseline)
    yaw = rng.uniform(-turn, turn) + (scene.track.heading(along) - scene.track.heading(beyond))[0]
    poses = (
        scene.sensor_pose(along, rng.uniform(-0.3, 0.3)),
        scene.sensor_pose(beyond, rng.uniform(-0.3, 0.3), float(yaw)),
    )
    # Traffic moves with the speed of the carrier, so that no position is inside a moving car.
    target, source = (
        simulate_scan(scene.world, sensor, pose, stream, time=length / scene.carrier.speed)
        for pose, stream, length in zip(poses, noise, (along, beyond), strict=True)
    )
    return SimulatedPair(target, source, poses[0].inverse() @ poses[1])


def _streams(seed: int) -> list[np.random.Generator]:
    """Return independent generators for the scene, the positions and the noise of two scans."""
    return [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)]


@functools.lru_cache(maxsize=3)
def _generated(name: str, seed: int) -> Scene:
    """Return the scene of a seed; generating one takes seconds, so the last three are kept."""
    return _named("scene", name, SCENES)(_streams(seed)[0])


def _named(kind: str, name: str, known: dict[str, _Maker]) -> _Maker:
    if name not in known:
        raise InvalidInput(f"{kind} must be one of {', '.join(known)}, got {name!r}")
    return known[name]
