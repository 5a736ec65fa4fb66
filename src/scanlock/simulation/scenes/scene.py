"""A world together with the way through it."""

from dataclasses import dataclass

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation.drive import Carrier, Drive, drive_along, sensor_on_ground
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.track import Track
from scanlock.simulation.world import World


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A world, a track through it that is free to drive, and what drives there.

    Attributes
    ----------
    name : str
    world : World
    track : Track
        Keeps clear of everything that stands still, and of traffic that is timed with it.
    carrier : Carrier
    """

    name: str
    world: World
    track: Track
    carrier: Carrier

    @property
    def ground(self) -> HeightField:
        """What the wheels stand on."""
        if self.world.ground is None:
            raise InvalidInput(f"the world of scene {self.name} has no ground to drive on")
        return self.world.ground

    def drive(
        self, rng: np.random.Generator, *, count: int, spacing: float, start: float = 0.0
    ) -> Drive:
        """Return poses along the track; see `drive_along`."""
        return drive_along(
            self.track, self.ground, self.carrier, rng, count=count, spacing=spacing, start=start
        )

    def standing_at(self, along: float, left: float = 0.0, turn: float = 0.0) -> Pose:
        """Return world_from_sensor at an arc length, some metres aside and turned [m, m, rad]."""
        heading = float(self.track.heading(along)[0]) + turn
        return sensor_on_ground(self.ground, self.carrier, self.track.at(along, left)[0], heading)
