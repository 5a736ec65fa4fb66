"""Simulated sweep of a spinning lidar, with exact poses and labels."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Labels, Points, Vector, frozen, short_repr
from scanlock.geometry.pose import Pose
from scanlock.simulation.motion import carried, checked_twist, screw
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.world import World


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class SimulatedScan:
    """Returns of one sweep in order of firing, with ground truth.

    Attributes
    ----------
    points : (n, 3) [m]
        Points as the sensor reports them: each in the frame of the sensor at its time of firing.
    labels, objects : (n,)
        `SurfaceClass` and object number of each point.
    rings : (n,)
        Index of the beam of each point.
    times : (n,) [s]
        Time of firing of each point, from the start of the sweep.
    pose : Pose
        ``world_from_sensor`` at the middle of the sweep.
    twist : (6,) [m/s, rad/s]
        Velocity of the sensor in its own frame, translation first; constant during the sweep.
    time : float [s]
        Time of the middle of the sweep.
    period : float [s]
        Duration of the sweep.
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

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for array in (
            self.points, self.labels, self.objects, self.rings, self.times, self.twist,
        ):  # fmt: skip
            frozen(array)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def start_pose(self) -> Pose:
        """``world_from_sensor`` at the start of the sweep."""
        return carried(self.pose, self.twist, -0.5 * self.period)

    @property
    def end_pose(self) -> Pose:
        """``world_from_sensor`` at the end of the sweep."""
        return carried(self.pose, self.twist, 0.5 * self.period)

    def deskewed(self) -> Points:
        """Return the points in the frame of `pose`, corrected for the motion during the sweep."""
        rotations, translations = screw(self.twist, self.times - 0.5 * self.period)
        return np.einsum("nij,nj->ni", rotations, self.points) + translations

    def in_world(self) -> Points:
        """Return the points in the frame of the world."""
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
    """Simulate one sweep of a sensor.

    Parameters
    ----------
    world : World
    sensor : Sensor
    pose : Pose
        ``world_from_sensor`` at the middle of the sweep.
    rng : Generator
        Source of range noise and lost returns. The number of draws does not depend on the world.
    time : float [s]
        Time of the middle of the sweep, for moving objects.
    twist : (6,) [m/s, rad/s], optional
        Constant velocity of the sensor in its own frame, translation first; zero by default.

    Returns
    -------
    SimulatedScan

    Raises
    ------
    InvalidInput
        A twist of another shape, or not finite.
    """
    twist = checked_twist(twist)
    firing = sensor.firing_times()
    rotations, translations = screw(twist, firing - 0.5 * sensor.period)
    beams = sensor.directions()
    firings = beams.reshape(sensor.azimuth_steps, sensor.beams, 3)
    directions = (firings @ (pose.rotation @ rotations).transpose(0, 2, 1)).reshape(-1, 3)
    origins = np.repeat(pose.apply(translations), sensor.beams, axis=0)
    times = np.repeat(firing, sensor.beams)
    hits = world.cast(origins, directions, time, times - 0.5 * sensor.period, sensor.max_range)

    noise = rng.standard_normal(len(beams)) * sensor.range_noise
    chance = sensor.detection(hits.distances, hits.cosines) * (1.0 - hits.losses)
    detected = np.flatnonzero(rng.random(len(beams)) < chance)
    return SimulatedScan(
        points=beams[detected] * (hits.distances[detected] + noise[detected])[:, None],
        labels=hits.labels[detected],
        objects=hits.objects[detected],
        rings=detected % sensor.beams,
        times=times[detected],
        pose=pose,
        twist=twist,
        time=time,
        period=sensor.period,
    )
