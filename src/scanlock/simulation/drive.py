"""How a vehicle carries its sensor over uneven ground."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Vector, frozen
from scanlock.errors import require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.motion import twist_between
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.terrain import Waves
from scanlock.simulation.scenes.track import Track

_SWEEP = 0.1
"""Twists are the mean velocity over this time [s], a sweep of the usual lidar."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Carrier:
    """A wheeled vehicle with a sensor on top."""

    sensor_height: float
    """Height of the sensor above the ground between the wheels [m]."""
    wheelbase: float
    """Distance between front and rear wheels [m]."""
    gauge: float
    """Distance between left and right wheels [m]."""
    speed: float
    """Speed along the track [m/s]."""
    sway: float
    """Standard deviation of roll and of pitch on the suspension [rad]."""
    wander: float
    """Standard deviation of the distance from the middle of the track [m]."""

    def __post_init__(self) -> None:
        require_positive("sensor_height", self.sensor_height, unit="m")
        require_positive("wheelbase", self.wheelbase, unit="m")
        require_positive("gauge", self.gauge, unit="m")
        require_positive("speed", self.speed, unit="m/s")
        require_at_least("sway", self.sway, 0.0, unit="rad")
        require_at_least("wander", self.wander, 0.0, unit="m")


CAR = Carrier(sensor_height=1.73, wheelbase=2.7, gauge=1.6, speed=8.5, sway=0.004, wander=0.12)
ROBOT = Carrier(sensor_height=1.0, wheelbase=0.6, gauge=0.5, speed=0.8, sway=0.012, wander=0.15)


@dataclass(frozen=True, slots=True, eq=False)
class Drive:
    """Where a sensor is, scan after scan.

    Attributes
    ----------
    poses : tuple of Pose
        world_from_sensor in the middle of each sweep.
    twists : (n, 6) [m/s, rad/s]
        Velocity of the sensor in its own frame, translation first.
    times : (n,) [s]
        When the middle of each sweep is.
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


def sensor_on_ground(ground: HeightField, carrier: Carrier, place: Vector, heading: float) -> Pose:
    """Return world_from_sensor of a vehicle whose four wheels stand at a (2,) place."""
    return Pose(*_on_wheels(ground, carrier, np.atleast_2d(place), np.array([heading]))[0])


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
    """Return `count` poses along a track, `spacing` [m] of arc length apart.

    A closed track is driven round and round. Time is arc length over the carrier's speed, so
    that traffic which keeps that speed keeps its distance.

    Raises
    ------
    InvalidInput
        A count below one or a spacing that is not positive.
    """
    require_count("count", count)
    require_positive("spacing", spacing, unit="m")
    wander = Waves.drawn(rng, carrier.wander, 20.0, 90.0)
    sway = [Waves.drawn(rng, carrier.sway, 6.0, 40.0) for _ in range(2)]
    along = start + spacing * np.arange(count, dtype=np.float64)
    way = 0.5 * _SWEEP * carrier.speed
    before, now, after = (
        _swaying(track, ground, carrier, wander, sway, along + shift) for shift in (-way, 0.0, way)
    )
    twists = np.array([twist_between(a, b, _SWEEP) for a, b in zip(before, after, strict=True)])
    return Drive(tuple(now), twists, along / carrier.speed)


def _swaying(
    track: Track,
    ground: HeightField,
    carrier: Carrier,
    wander: Waves,
    sway: list[Waves],
    along: Vector,
) -> list[Pose]:
    def place(at: Vector) -> Matrix:
        return track.at(at, wander.at(np.column_stack([at, np.zeros_like(at)])))

    step = place(along + 0.5) - place(along - 0.5)
    frames = _on_wheels(ground, carrier, place(along), np.arctan2(step[:, 1], step[:, 0]))
    tilts = np.column_stack(
        [*(wave.at(np.column_stack([along, np.zeros_like(along)])) for wave in sway),
         np.zeros_like(along)]
    )  # fmt: skip
    return [
        Pose(rotation @ exp_rotation(tilt), translation)
        for (rotation, translation), tilt in zip(frames, tilts, strict=True)
    ]


def _on_wheels(
    ground: HeightField, carrier: Carrier, places: Matrix, headings: Vector
) -> list[tuple[NDArray[np.float64], Vector]]:
    """Return rotation and sensor position of vehicles that stand on four wheels."""
    ahead = 0.5 * carrier.wheelbase * np.column_stack([np.cos(headings), np.sin(headings)])
    left = 0.5 * carrier.gauge * np.column_stack([-np.sin(headings), np.cos(headings)])
    front_left, front_right, rear_left, rear_right = (
        ground.lifted(places + a * ahead + b * left) for a in (1, -1) for b in (1, -1)
    )
    x = _units(front_left + front_right - rear_left - rear_right)
    z = _units(np.cross(x, front_left + rear_left - front_right - rear_right))
    middle = 0.25 * (front_left + front_right + rear_left + rear_right)
    rotations = np.stack([x, np.cross(z, x), z], axis=2)
    return list(zip(rotations, middle + carrier.sensor_height * z, strict=True))


def _units(vectors: Matrix) -> Matrix:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
