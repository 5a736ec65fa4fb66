"""Spinning lidars: where their beams point, how far they see and how noisy they are."""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

_SHARPEST = 1e-9
"""Cosines and widths below this count as this, which no return can tell from zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensor:
    """A spinning multi-beam lidar. It turns clockwise seen from above, starting backwards.

    The sensor frame has x ahead, y to the left and z up; each sweep begins and ends behind the
    sensor, so the middle of a sweep looks straight ahead.
    """

    name: str
    """What the sensor is called."""
    elevations: tuple[float, ...]
    """Angle of each beam above the x-y plane [rad]; the index is the point's ring."""
    azimuth_offsets: tuple[float, ...]
    """How far each beam points to the left of the firing direction [rad]."""
    azimuth_steps: int
    """Firings in one turn; every beam is fired once in each."""
    rate: float
    """Turns a second [Hz]."""
    min_range: float
    """Nearer returns are lost [m]."""
    max_range: float
    """Reach to a surface that faces the sensor [m]."""
    range_noise: float
    """Standard deviation of a range [m]."""
    grazing: float = 0.25
    """The reach shrinks with the cosine of incidence to this power.

    A quarter gives the data sheet's 50 m on pavement for 120 m and a car's height.
    """
    fading: float = 0.15
    """Returns thin out from this fraction short of the reach to as far beyond it."""
    dropout: float = 0.02
    """Share of pulses lost whatever they meet."""

    def __post_init__(self) -> None:
        if len(self.elevations) == 0 or len(self.azimuth_offsets) != len(self.elevations):
            raise InvalidInput(
                "elevations and azimuth_offsets must have one entry a beam, got "
                f"{len(self.elevations)} and {len(self.azimuth_offsets)}"
            )
        angles = (*self.elevations, *self.azimuth_offsets)
        if not all(math.isfinite(angle) for angle in angles):
            raise InvalidInput("elevations and azimuth_offsets must be finite")
        require_count("azimuth_steps", self.azimuth_steps)
        require_positive("rate", self.rate, unit="Hz")
        require_at_least("min_range", self.min_range, 0.0, unit="m")
        require_positive("max_range", self.max_range, unit="m")
        if self.max_range <= self.min_range:
            raise InvalidInput(
                f"max_range must exceed min_range, got {self.max_range} <= {self.min_range} m"
            )
        require_at_least("range_noise", self.range_noise, 0.0, unit="m")
        require_at_least("grazing", self.grazing, 0.0)
        require_fraction("fading", self.fading)
        require_fraction("dropout", self.dropout)

    @property
    def beams(self) -> int:
        """How many beams a firing has."""
        return len(self.elevations)

    @property
    def period(self) -> float:
        """How long a sweep lasts [s]."""
        return 1.0 / self.rate

    def firing_times(self) -> Vector:
        """Return when each firing happens after the start of a sweep, (azimuth_steps,) [s]."""
        return np.arange(self.azimuth_steps, dtype=np.float64) * (self.period / self.azimuth_steps)

    def directions(self) -> Points:
        """Return the unit vectors (azimuth_steps * beams, 3) of a sweep in order of firing."""
        turn = np.pi - 2.0 * np.pi * np.arange(self.azimuth_steps) / self.azimuth_steps
        azimuth = turn[:, None] + np.array(self.azimuth_offsets)
        elevation = np.broadcast_to(np.array(self.elevations), azimuth.shape)
        level = np.cos(elevation)
        return np.stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=2
        ).reshape(-1, 3)

    def detection(self, distances: Vector, cosines: Vector) -> Vector:
        """Return the chance (n,) that a pulse comes back from so far at such an incidence."""
        reach = self.max_range * np.maximum(cosines, _SHARPEST) ** self.grazing
        short_of = 1.0 + self.fading - np.asarray(distances) / reach
        chance = np.clip(short_of / max(2.0 * self.fading, _SHARPEST), 0.0, 1.0)
        seen = (distances >= self.min_range) & (distances <= self.max_range)
        return np.where(seen, chance * (1.0 - self.dropout), 0.0)


def hdl_64e() -> Sensor:
    """Return a Velodyne HDL-64E: 64 beams in two blocks, +2 to -24.8 degrees, 120 m."""
    upper = np.linspace(2.0, 2.0 - 31.0 / 3.0, 32)
    lower = np.linspace(-8.83, -24.8, 32)
    elevations = np.concatenate([upper, lower])
    # The factory's angles scatter by a few hundredths of a degree about the nominal ones.
    elevations[1:-1] += 0.08 * (_scatter(62) - 0.5)
    # Neighbouring beams sit in different columns of the optical block.
    offsets = np.tile([-0.06, 0.02, -0.02, 0.06], 16)
    return Sensor(
        name="hdl_64e",
        elevations=_radians(elevations),
        azimuth_offsets=_radians(offsets),
        azimuth_steps=2083,
        rate=10.0,
        min_range=0.9,
        max_range=120.0,
        range_noise=0.02,
    )


def hdl_32e() -> Sensor:
    """Return a Velodyne HDL-32E: 32 beams, +10.67 to -30.67 degrees, 70 m."""
    return Sensor(
        name="hdl_32e",
        elevations=_radians(np.linspace(10.67, -30.67, 32)),
        azimuth_offsets=(0.0,) * 32,
        azimuth_steps=2170,
        rate=10.0,
        min_range=1.0,
        max_range=70.0,
        range_noise=0.02,
    )


def os1_64() -> Sensor:
    """Return an Ouster OS1-64: 64 beams over +-16.6 degrees in four staggered columns, 120 m."""
    return Sensor(
        name="os1_64",
        elevations=_radians(np.linspace(16.6, -16.6, 64)),
        azimuth_offsets=_radians(np.tile([3.16, 1.05, -1.05, -3.16], 16)),
        azimuth_steps=1024,
        rate=10.0,
        min_range=0.8,
        max_range=120.0,
        range_noise=0.03,
    )


SENSORS = {"hdl_64e": hdl_64e, "hdl_32e": hdl_32e, "os1_64": os1_64}
"""Every sensor by name."""


def _scatter(count: int) -> Vector:
    """Return numbers in [0, 1) that look random and are always the same."""
    return (np.arange(1, count + 1, dtype=np.float64) * _GOLDEN) % 1.0


def _radians(degrees: Vector) -> tuple[float, ...]:
    return tuple(float(angle) for angle in np.radians(degrees))
