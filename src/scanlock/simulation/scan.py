"""One sweep of a sensor through a world, with everything that is true of it."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation.motion import carried, screw
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.world import World


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedScan:
    """The returns of one sweep, in order of firing, and the truth about them.

    Attributes
    ----------
    points : (n, 3) [m]
        As a sensor reports them: each in the sensor frame at its own moment of firing. A sweep
        with no return has none.
    labels, objects : (n,)
        `SurfaceClass` and number of the object that each point lies on.
    rings : (n,)
        The beam that each came from.
    times : (n,) [s]
        When each was fired, after the start of the sweep.
    pose : Pose
        world_from_sensor in the middle of the sweep.
    twist : (6,) [m/s, rad/s]
        Velocity of the sensor in its own frame, translation first.
    time : float [s]
        When the middle of the sweep was.
    period : float [s]
        How long the sweep lasted.
    """

    points: Points
    labels: Labels
    objects: Labels
    rings: Labels
    times: Vector
    pose: Pose
    twist: Vector
    time: float
    period: float

    def __post_init__(self) -> None:
        for array in (
            self.points, self.labels, self.objects, self.rings, self.times, self.twist,
        ):  # fmt: skip
            frozen(array)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def start_pose(self) -> Pose:
        """world_from_sensor when the sweep began."""
        return carried(self.pose, self.twist, -0.5 * self.period)

    @property
    def end_pose(self) -> Pose:
        """world_from_sensor when the sweep ended."""
        return carried(self.pose, self.twist, 0.5 * self.period)

    def deskewed(self) -> Points:
        """Return the points in the sensor frame of `pose`, the motion during the sweep undone."""
        rotations, translations = screw(self.twist, self.times - 0.5 * self.period)
        return np.einsum("nij,nj->ni", rotations, self.points) + translations

    def in_world(self) -> Points:
        """Return the points in the world."""
        return self.pose.apply(self.deskewed())


def simulate_scan(
    world: World,
    sensor: Sensor,
    pose: Pose,
    rng: np.random.Generator,
    *,
    time: float = 0.0,
    twist: Vector | None = None,
) -> SimulatedScan:
    """Return what a sensor sees in one sweep.

    Parameters
    ----------
    world, sensor : World, Sensor
        What is seen, and by what.
    pose : Pose
        world_from_sensor in the middle of the sweep.
    rng : Generator
        Draws range noise and lost returns; as many numbers whatever is seen.
    time : float [s]
        When the middle of the sweep is, for the world's moving objects.
    twist : (6,) [m/s, rad/s], optional
        Velocity of the sensor in its own frame, translation first; it keeps it during the sweep.
        At rest by default.

    Raises
    ------
    InvalidInput
        A twist of another shape, or not finite.
    """
    twist = np.zeros(6) if twist is None else np.array(twist, np.float64)
    if twist.shape != (6,) or not np.isfinite(twist).all():
        raise InvalidInput(f"twist must be six finite numbers, got {twist.tolist()}")
    firing = sensor.firing_times()
    rotations, translations = screw(twist, firing - 0.5 * sensor.period)
    beams = sensor.directions()
    fired = beams.reshape(sensor.azimuth_steps, sensor.beams, 3)
    directions = (fired @ (pose.rotation @ rotations).transpose(0, 2, 1)).reshape(-1, 3)
    origins = np.repeat(pose.apply(translations), sensor.beams, axis=0)
    times = np.repeat(firing, sensor.beams)
    hits = world.cast(origins, directions, time, times - 0.5 * sensor.period, sensor.max_range)

    noise = rng.standard_normal(len(beams)) * sensor.range_noise
    chance = sensor.detection(hits.distances, hits.cosines) * (1.0 - hits.losses)
    seen = np.flatnonzero(rng.random(len(beams)) < chance)
    return SimulatedScan(
        points=beams[seen] * (hits.distances[seen] + noise[seen])[:, None],
        labels=hits.labels[seen],
        objects=hits.objects[seen],
        rings=seen % sensor.beams,
        times=times[seen],
        pose=pose,
        twist=twist,
        time=time,
        period=sensor.period,
    )
