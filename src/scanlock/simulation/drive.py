"""Poses of a sensor on a vehicle that drives over uneven ground."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector, frozen
from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.motion import twist_between
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.terrain.waves import Waves

_SWEEP_DURATION = 0.1
"""Time over which twists are averaged [s]: a sweep of a common lidar."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Carrier:
    """A four-wheeled vehicle with a sensor."""

    sensor_height: float
    """Height of the sensor above the centre of the wheel contacts [m]."""
    wheelbase: float
    """Distance between the front and the rear wheels [m]."""
    gauge: float
    """Distance between the left and the right wheels [m]."""
    speed: float
    """Speed along the track [m/s]."""
    sway: float
    """Standard deviation of roll and pitch on the suspension [rad]."""
    wander: float
    """Standard deviation of the lateral offset from the track [m]."""

    def __post_init__(self) -> None:
        require_positive("sensor_height", self.sensor_height, unit="m")
        require_positive("wheelbase", self.wheelbase, unit="m")
        require_positive("gauge", self.gauge, unit="m")
        require_positive("speed", self.speed, unit="m/s")
        require_at_least("sway", self.sway, 0.0, unit="rad")
        require_at_least("wander", self.wander, 0.0, unit="m")


CAR = Carrier(sensor_height=1.73, wheelbase=2.7, gauge=1.6, speed=8.5, sway=0.004, wander=0.12)
"""A passenger car with a sensor on its roof."""

ROBOT = Carrier(sensor_height=1.0, wheelbase=0.6, gauge=0.5, speed=0.8, sway=0.012, wander=0.15)
"""A slow outdoor robot."""


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Poses, velocities and times of a sensor, one for each scan.

    Attributes
    ----------
    poses : tuple of Pose
        ``world_from_sensor`` at the middle of each sweep.
    twists : (n, 6) [m/s, rad/s]
        Velocity of the sensor in its own frame, translation first.
    times : (n,) [s]
        Time of the middle of each sweep.
    """

    poses: tuple[Pose, ...]
    twists: Matrix
    times: Vector

    def __post_init__(self) -> None:
        frozen(self.twists)
        frozen(self.times)

    def __len__(self) -> int:
        return len(self.poses)

    def __iter__(self) -> Iterator[Pose]:
        return iter(self.poses)


def sensor_on_ground(
    ground: HeightField, carrier: Carrier, position: Vector, heading: float
) -> Pose:
    """Return ``world_from_sensor`` of a vehicle at a (2,) position [m] and a heading [rad]."""
    return Pose(*_sensor_poses(ground, carrier, np.atleast_2d(position), np.array([heading]))[0])


def drive_along(
    track: Track,
    ground: HeightField,
    carrier: Carrier,
    rng: np.random.Generator,
    *,
    count: int,
    spacing: float,
    start: float = 0.0,
) -> Drive:
    """Simulate a drive along a track at constant speed.

    Parameters
    ----------
    track, ground, carrier : Track, HeightField, Carrier
        Path, terrain and vehicle. A closed track is driven repeatedly.
    rng : Generator
        Source of the lateral offsets and of the sway.
    count : int
        Number of poses.
    spacing : float [m]
        Arc length between poses.
    start : float [m]
        Arc length of the first pose.

    Returns
    -------
    Drive
        With times equal to arc length over speed, so that traffic of the same speed keeps its
        distance.

    Raises
    ------
    InvalidInput
        A count below one, or a spacing that is not positive.
    """
    require_count("count", count)
    require_positive("spacing", spacing, unit="m")
    wander = Waves.drawn(rng, carrier.wander, 20.0, 90.0)
    sway = [Waves.drawn(rng, carrier.sway, 6.0, 40.0) for _ in range(2)]
    along = start + spacing * np.arange(count, dtype=np.float64)
    half = 0.5 * _SWEEP_DURATION * carrier.speed
    before, now, after = (
        _swaying_poses(track, ground, carrier, wander, sway, along + shift)
        for shift in (-half, 0.0, half)
    )
    twists = np.array(
        [twist_between(a, b, _SWEEP_DURATION) for a, b in zip(before, after, strict=True)]
    )
    return Drive(tuple(now), twists, along / carrier.speed)


def _swaying_poses(
    track: Track,
    ground: HeightField,
    carrier: Carrier,
    wander: Waves,
    sway: list[Waves],
    along: Vector,
) -> list[Pose]:
    def position(at: Vector) -> Matrix:
        return track.at(at, wander.at(np.column_stack([at, np.zeros_like(at)])))

    step = position(along + 0.5) - position(along - 0.5)
    frames = _sensor_poses(ground, carrier, position(along), np.arctan2(step[:, 1], step[:, 0]))
    tilts = np.column_stack(
        [*(wave.at(np.column_stack([along, np.zeros_like(along)])) for wave in sway),
         np.zeros_like(along)]
    )  # fmt: skip
    return [
        Pose(rotation @ exp_rotation(tilt), translation)
        for (rotation, translation), tilt in zip(frames, tilts, strict=True)
    ]


def _sensor_poses(
    ground: HeightField, carrier: Carrier, positions: Matrix, headings: Vector
) -> list[tuple[NDArray[np.float64], Vector]]:
    """Return rotation and position of the sensor for (n, 2) positions of the vehicle."""
    ahead = 0.5 * carrier.wheelbase * np.column_stack([np.cos(headings), np.sin(headings)])
    left = 0.5 * carrier.gauge * np.column_stack([-np.sin(headings), np.cos(headings)])
    front_left, front_right, rear_left, rear_right = (
        ground.lifted(positions + a * ahead + b * left) for a in (1, -1) for b in (1, -1)
    )
    x = _units(front_left + front_right - rear_left - rear_right)
    z = _units(np.cross(x, front_left + rear_left - front_right - rear_right))
    middle = 0.25 * (front_left + front_right + rear_left + rear_right)
    rotations = np.stack([x, np.cross(z, x), z], axis=2)
    return list(zip(rotations, middle + carrier.sensor_height * z, strict=True))


def _units(vectors: Matrix) -> Matrix:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
