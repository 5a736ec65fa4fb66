"""Scene: a world with a track through it and a vehicle."""

from dataclasses import dataclass

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation.drive import Carrier, Drive, drive_along, sensor_on_ground
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.world import World


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Scene:
    """A world, a collision-free track through it, and the vehicle on it.

    Attributes
    ----------
    name : str
        Name of the scene.
    world : World
    track : Track
        Path free of static objects, and of moving objects at the times of a drive.
    carrier : Carrier
        Vehicle with the sensor.
    """

    name: str
    world: World
    track: Track
    carrier: Carrier

    @property
    def ground(self) -> HeightField:
        """Terrain of the world."""
        if self.world.ground is None:
            raise InvalidInput(
                f"the world of scene {self.name} must have ground to drive on, got none"
            )
        return self.world.ground

    def drive(
        self, rng: np.random.Generator, *, count: int, spacing: float, start: float = 0.0
    ) -> Drive:
        """Simulate a drive along the track; see `drive_along`."""
        return drive_along(
            self.track, self.ground, self.carrier, rng, count=count, spacing=spacing, start=start
        )

    def sensor_pose(self, along: float, left: float = 0.0, turn: float = 0.0) -> Pose:
        """Return ``world_from_sensor`` of the vehicle at rest.

        Parameters
        ----------
        along : float [m]
            Arc length along the track.
        left : float [m]
            Offset to the left of the track.
        turn : float [rad]
            Rotation to the left of the heading of the track.
        """
        heading = float(self.track.heading(along)[0]) + turn
        return sensor_on_ground(self.ground, self.carrier, self.track.at(along, left)[0], heading)
