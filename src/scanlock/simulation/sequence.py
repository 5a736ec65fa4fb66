"""Scans along a drive, each made when asked for; and pairs of scans with their exact pose."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from scanlock.errors import InvalidInput, require_count
from scanlock.geometry.pose import Pose
from scanlock.simulation.drive import Drive
from scanlock.simulation.scan import SimulatedScan, simulate_scan
from scanlock.simulation.scenes.forests import forest, forest_walk
from scanlock.simulation.scenes.rugged import rugged, rugged_drive
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.streets import street, street_drive
from scanlock.simulation.sensors import SENSORS, Sensor
from scanlock.simulation.world import World

_Maker = TypeVar("_Maker")

SCENES = {"street": street, "forest": forest, "rugged": rugged}
"""Every scene by name; each is drawn by a generator."""

_DRIVES = {"street": street_drive, "forest": forest_walk, "rugged": rugged_drive}
"""What moves through each."""


def drive_through(scene: str, *, count: int, seed: int) -> tuple[Scene, Drive]:
    """Return a scene and a drive of `count` sweeps through it, both drawn from the seed.

    Raises
    ------
    InvalidInput
        An unknown scene.
    """
    require_count("seed", seed, minimum=0)
    make = _named("scene", scene, SCENES)
    building, driving = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(2))
    place = make(building)
    return place, _DRIVES[scene](place, driving, count=count)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedSequence:
    """The scans of a sensor along a drive.

    Scan k depends on the seed and on k alone, not on which scans were made before.

    Attributes
    ----------
    world : World
    sensor : Sensor
    drive : Drive
    seed : int
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
        """Return scan `index`; negative ones count from the end."""
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
        """Yield some scans, such as every tenth: ``scans(range(0, len(sequence), 10))``."""
        return (self[index] for index in indices)


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedPair:
    """Two scans of one world by a sensor at rest, and the exact pose between them.

    Attributes
    ----------
    target, source : SimulatedScan
    target_from_source : Pose
        Carries points of the source onto the target.
    """

    target: SimulatedScan
    source: SimulatedScan
    target_from_source: Pose


def scan_pair(
    scene: str | Scene,
    sensor: str | Sensor,
    seed: int,
    *,
    baseline: tuple[float, float] = (3.0, 5.0),
    turn: float = np.radians(15.0),
) -> SimulatedPair:
    """Return two scans from a random place of a scene, some metres apart and a bit turned.

    Parameters
    ----------
    scene : str or Scene
        "street", "forest" or "rugged", drawn anew from the seed; or a scene made before.
    sensor : str or Sensor
        "hdl_64e", "hdl_32e" or "os1_64", or a sensor of your own.
    seed : int
        Decides everything: the scene (if named), the places and the noise.
    baseline : (2,) [m]
        Least and greatest distance along the track between the two.
    turn : float [rad]
        The source looks up to this far to the left or right of where the target looks.

    Raises
    ------
    InvalidInput
        An unknown name, or a baseline whose ends are negative or in the wrong order.
    """
    require_count("seed", seed, minimum=0)
    if not 0.0 <= baseline[0] <= baseline[1]:
        raise InvalidInput(f"baseline must be 0 <= least <= greatest, got {baseline} m")
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(4)]
    if isinstance(sensor, str):
        sensor = _named("sensor", sensor, SENSORS)()
    if isinstance(scene, str):
        scene = _named("scene", scene, SCENES)(streams[0])
    rng = streams[1]
    along = rng.uniform(0.0, scene.track.length)
    beyond = along + rng.uniform(*baseline)
    yaw = rng.uniform(-turn, turn) + (scene.track.heading(along) - scene.track.heading(beyond))[0]
    poses = (
        scene.standing_at(along, rng.uniform(-0.3, 0.3)),
        scene.standing_at(beyond, rng.uniform(-0.3, 0.3), float(yaw)),
    )
    # Traffic keeps time with the track, so neither place is inside of a moving car.
    target, source = (
        simulate_scan(scene.world, sensor, pose, stream, time=at / scene.carrier.speed)
        for pose, stream, at in zip(poses, streams[2:], (along, beyond), strict=True)
    )
    return SimulatedPair(target, source, poses[0].inverse() @ poses[1])


def _named(kind: str, name: str, known: dict[str, _Maker]) -> _Maker:
    if name not in known:
        raise InvalidInput(f"{kind} must be one of {', '.join(known)}, got {name!r}")
    return known[name]
