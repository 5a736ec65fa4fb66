"""Rigs: several lidars on one rigid carrier, with their exact extrinsics."""

from dataclasses import dataclass

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.scan import SimulatedScan, simulate_scan
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.world import World

_HALF_WIDTH = 0.4
"""Half distance between sensors that look apart [m]."""

_MAST = 0.35
"""Distance between sensors one above the other [m]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Mount:
    """A sensor with its extrinsic."""

    sensor: Sensor
    """The lidar."""
    rig_from_sensor: Pose
    """Pose of the sensor in the frame of the rig, which has x ahead, y to the left and z up."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Rig:
    """Sensors on one carrier, which sweep at the same time."""

    mounts: tuple[Mount, ...]
    """Sensors with their extrinsics; at least one."""

    def __post_init__(self) -> None:
        if not self.mounts:
            raise InvalidInput("mounts must contain at least one sensor, got none")

    @classmethod
    def looking_apart(cls, sensor: Sensor, angle: float) -> "Rig":
        """Return a rig of two equal sensors that look to the left and to the right.

        Parameters
        ----------
        sensor : Sensor
        angle : float [rad]
            Angle between the directions straight ahead of both.
        """
        return cls._pair(sensor, sensor, (0.0, 0.0, 0.5 * angle), (0.0, _HALF_WIDTH, 0.0))

    @classmethod
    def tilted_apart(cls, sensor: Sensor, angle: float) -> "Rig":
        """Return a rig of two equal sensors whose axes are tilted to the left and to the right.

        Parameters
        ----------
        sensor : Sensor
        angle : float [rad]
            Tilt of each axis from the vertical.
        """
        return cls._pair(sensor, sensor, (-angle, 0.0, 0.0), (0.0, _HALF_WIDTH, 0.0))

    @classmethod
    def stacked(cls, lower: Sensor, upper: Sensor, yaw: float = 0.0) -> "Rig":
        """Return a rig of two sensors in one place, one above the other.

        Parameters
        ----------
        lower, upper : Sensor
        yaw : float [rad]
            Heading of the upper one relative to the lower one.
        """
        return cls._pair(lower, upper, (0.0, 0.0, -0.5 * yaw), (0.0, 0.0, -0.5 * _MAST))

    @classmethod
    def _pair(
        cls,
        first: Sensor,
        second: Sensor,
        rotation: tuple[float, float, float],
        translation: tuple[float, float, float],
    ) -> "Rig":
        """Return a rig of two sensors at opposite translations [m], with opposite rotations."""
        return cls(
            mounts=tuple(
                Mount(
                    sensor=sensor,
                    rig_from_sensor=Pose(
                        exp_rotation(sign * np.array(rotation)), sign * np.array(translation)
                    ),
                )
                for sensor, sign in ((first, 1.0), (second, -1.0))
            )
        )


def simulate_rig(
    world: World, rig: Rig, pose: Pose, rng: np.random.Generator, *, time: float = 0.0
) -> tuple[SimulatedScan, ...]:
    """Simulate one sweep of every sensor of a rig at rest.

    Parameters
    ----------
    world : World
    rig : Rig
    pose : Pose
        ``world_from_rig``.
    rng : Generator
        Source of range noise and lost returns.
    time : float [s]
        Time of the middle of the sweeps, for moving objects.

    Returns
    -------
    tuple of SimulatedScan
        One per mount; the pose of each is ``world_from_sensor``.
    """
    return tuple(
        simulate_scan(world, mount.sensor, pose @ mount.rig_from_sensor, rng, time=time)
        for mount in rig.mounts
    )
