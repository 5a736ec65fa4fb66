"""Simulated sequences of ladar frames along a drive over rugged terrain."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.simulation.drive import Drive
from scanlock.simulation.ladar.mount import PanTiltMount, TiltSweep
from scanlock.simulation.ladar.scan import LadarScan, simulate_frame
from scanlock.simulation.ladar.sensor import FacetLadar
from scanlock.simulation.scenes.rugged import rugged
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.world import World

AHEAD_AND_DOWN = TiltSweep(tilt=math.radians(-18.0))
"""Fixed tilt at which frames have about as many points as in the paper, 4848 to 5352."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class LadarSequence:
    """Frames of a ladar along the drive of a vehicle, simulated on access.

    Frame k depends only on the seed and on k, not on which frames were simulated before. The exact
    pose between two frames is ``target.pose.inverse() @ source.pose``.

    Attributes
    ----------
    world : World
    ladar : FacetLadar
    mount : PanTiltMount
    drive : Drive
        ``world_from_vehicle`` at the middle of each frame.
    seed : int
        Seed of range noise and lost returns.
    look : TiltSweep
        Motion of the platform.
    """

    world: World
    ladar: FacetLadar
    mount: PanTiltMount
    drive: Drive
    seed: int
    look: TiltSweep = AHEAD_AND_DOWN

    def __post_init__(self) -> None:
        require_count("seed", self.seed, minimum=0)

    def __len__(self) -> int:
        return len(self.drive)

    def __getitem__(self, index: int) -> LadarScan:
        """Simulate frame `index`; negative indices count from the end."""
        if not -len(self) <= index < len(self):
            raise IndexError(f"frame {index} of a sequence of {len(self)}")
        k = index % len(self)
        rng = np.random.default_rng(np.random.SeedSequence(self.seed, spawn_key=(k,)))
        time = float(self.drive.times[k])
        pan, tilt = self.look.at(time)
        return simulate_frame(
            self.world,
            self.ladar,
            self.mount,
            self.drive.poses[k],
            rng,
            pan=pan,
            tilt=tilt,
            time=time,
            twist=self.drive.twists[k],
        )

    def __iter__(self) -> Iterator[LadarScan]:
        return self.scans(range(len(self)))

    def scans(self, indices: Iterable[int]) -> Iterator[LadarScan]:
        """Yield the frames of some indices, such as ``range(0, len(sequence), 20)``."""
        return (self[index] for index in indices)


def ladar_run(
    seed: int,
    *,
    scene: Scene | None = None,
    count: int = 21,
    speed: float = 4.2,
    start: float | None = None,
    ladar: FacetLadar | None = None,
    mount: PanTiltMount | None = None,
    look: TiltSweep = AHEAD_AND_DOWN,
) -> LadarSequence:
    """Simulate the frames of a ladar on a vehicle at constant speed over rugged terrain.

    Parameters
    ----------
    seed : int
        Seed of all that is not given: the scene, the start, the drive and the noise.
    scene : Scene, optional
        Scene to drive through; rugged terrain generated from the seed by default.
    count : int
        Number of frames.
    speed : float [m/s]
        Speed of the vehicle; 15 km/h by default.
    start : float [m], optional
        Arc length of the first frame along the track; random by default.
    ladar : FacetLadar, optional
    mount : PanTiltMount, optional
        Mount of the ladar on the vehicle.
    look : TiltSweep
        Motion of the platform.

    Returns
    -------
    LadarSequence

    Raises
    ------
    InvalidInput
        A negative seed, a count below one, or a speed that is not positive.

    Notes
    -----
    The distance of closest points at the exact pose increases with the distance between frames,
    since grass is hit at other points; ``scanlock reproduce ladar`` measures it. At 15 km/h and ten
    frames per second, frames k and k + 20 are 8 m apart and overlap little; at 0.1 m/s, 0.2 m. The
    small distances in the paper imply a vehicle that hardly moved.
    """
    require_count("seed", seed, minimum=0)
    require_positive("speed", speed, unit="m/s")
    scene_rng, start_rng, drive_rng = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
    )
    if scene is None:
        scene = rugged(scene_rng)
    if start is None:
        start = float(start_rng.uniform(0.0, scene.track.length))
    ladar, mount = ladar or FacetLadar(), mount or PanTiltMount()
    at_speed = replace(scene, carrier=replace(scene.carrier, speed=speed))
    drive = at_speed.drive(drive_rng, count=count, spacing=speed / ladar.rate, start=start)
    return LadarSequence(
        world=scene.world, ladar=ladar, mount=mount, drive=drive, seed=seed, look=look
    )
