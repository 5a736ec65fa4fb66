"""Frames of a facet ladar along a drive over rugged terrain, each made when asked for."""

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
"""A held tilt that fills about as much of the image as the paper's 4848 to 5352 points do."""


@dataclass(frozen=True, slots=True, eq=False)
class LadarSequence:
    """The frames of a ladar along the drive of a vehicle.

    Frame k depends on the seed and on k alone, not on which frames were made before. The exact
    pose between two frames is ``target.pose.inverse() @ source.pose``, of the vehicle.

    Attributes
    ----------
    world : World
    ladar : FacetLadar
    mount : PanTiltMount
    drive : Drive
        world_from_vehicle in the middle of each frame.
    seed : int
    look : TiltSweep
        Where the platform looks at the times of the drive.
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
        """Return frame `index`; negative ones count from the end."""
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
        """Yield some frames, such as every twentieth: ``scans(range(0, len(sequence), 20))``."""
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
    """Return the frames of a ladar on a vehicle at a steady speed over rugged terrain.

    Frames k and k + 1 are consecutive, k and k + 20 twenty apart. How close two frames lie at the
    exact pose follows from the way between them, for a ladar that has moved meets other points of
    the same grass; ``scanlock reproduce ladar`` tells by how much. So close as the paper's pairs
    lie, its vehicle must have stood nearly still.

    Parameters
    ----------
    seed : int
        Decides everything that is not given: the scene, the place, the drive and the noise.
    scene : Scene, optional
        Where to drive; rugged terrain drawn from the seed by default.
    count : int
        How many frames.
    speed : float [m/s]
        Of the vehicle; 15 km/h by default. At the ladar's ten frames a second, frames twenty
        apart are then taken 8 m from each other and have little in common; at 0.1 m/s, 0.2 m.
    start : float [m], optional
        Arc length along the scene's track where the drive begins; anywhere by default.
    ladar, mount, look : FacetLadar, PanTiltMount, TiltSweep
        The ladar, how it is fixed to the vehicle, and where it looks.

    Raises
    ------
    InvalidInput
        A seed or a count that is none, or a speed that is not positive.
    """
    require_count("seed", seed, minimum=0)
    require_positive("speed", speed, unit="m/s")
    building, placing, driving = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)
    )
    if scene is None:
        scene = rugged(building)
    if start is None:
        start = float(placing.uniform(0.0, scene.track.length))
    ladar, mount = ladar or FacetLadar(), mount or PanTiltMount()
    at_speed = replace(scene, carrier=replace(scene.carrier, speed=speed))
    drive = at_speed.drive(driving, count=count, spacing=speed / ladar.rate, start=start)
    return LadarSequence(scene.world, ladar, mount, drive, seed, look)
