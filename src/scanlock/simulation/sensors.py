"""Spinning lidars: beam directions, detection range and noise."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Points, Vector
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)

_GOLDEN = (math.sqrt(5.0) - 1.0) / 2.0

_MIN_COSINE = 1e-9
"""Lower bound of cosines and of fading widths, to avoid a division by zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensor:
    """A spinning multi-beam lidar that rotates clockwise, seen from above.

    The frame of the sensor has x ahead, y to the left and z up. A sweep begins and ends behind the
    sensor, so its middle is straight ahead.
    """

    name: str
    """Name of the sensor."""
    elevations: tuple[float, ...]
    """Angle of each beam above the x-y plane [rad], by ring."""
    azimuth_offsets: tuple[float, ...]
    """Angle of each beam to the left of the firing direction [rad]."""
    azimuth_steps: int
    """Number of firings per revolution; each fires every beam once."""
    rate: float
    """Revolutions per second [Hz]."""
    min_range: float
    """Minimum range of a return [m]."""
    max_range: float
    """Maximum range of a return at perpendicular incidence [m]."""
    range_noise: float
    """Standard deviation of the range [m]."""
    grazing: float = 0.25
    """Exponent of the cosine of incidence in the detection range.

    A quarter gives the 50 m on pavement of the data sheet, for 120 m and the height of a car.
    """
    fading: float = 0.15
    """Half width of the interval in which detection fades, as a fraction of the detection range."""
    dropout: float = 0.02
    """Ratio of pulses lost independent of the surface."""

    def __post_init__(self) -> None:
        if len(self.elevations) == 0 or len(self.azimuth_offsets) != len(self.elevations):
            raise InvalidInput(
                "elevations and azimuth_offsets must have one entry per beam, got "
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
        """Number of beams."""
        return len(self.elevations)

    @property
    def period(self) -> float:
        """Duration of a sweep [s]."""
        return 1.0 / self.rate

    def firing_times(self) -> Vector:
        """Return the (azimuth_steps,) times of the firings, from the start of a sweep [s]."""
        return np.arange(self.azimuth_steps, dtype=np.float64) * (self.period / self.azimuth_steps)

    def directions(self) -> Points:
        """Return the (azimuth_steps * beams, 3) unit vectors of a sweep in order of firing."""
        heading = np.pi - 2.0 * np.pi * np.arange(self.azimuth_steps) / self.azimuth_steps
        azimuth = heading[:, None] + np.array(self.azimuth_offsets)
        elevation = np.broadcast_to(np.array(self.elevations), azimuth.shape)
        return unit_vectors(azimuth, elevation).reshape(-1, 3)

    def detection(self, distances: Vector, cosines: Vector) -> Vector:
        """Compute the probability of a return.

        Parameters
        ----------
        distances : (n,) [m]
        cosines : (n,)
            Cosines of the angle of incidence.

        Returns
        -------
        (n,)
        """
        detection_range = self.max_range * np.maximum(cosines, _MIN_COSINE) ** self.grazing
        margin = 1.0 + self.fading - np.asarray(distances) / detection_range
        probability = np.clip(margin / max(2.0 * self.fading, _MIN_COSINE), 0.0, 1.0)
        in_range = (distances >= self.min_range) & (distances <= self.max_range)
        return np.where(in_range, probability * (1.0 - self.dropout), 0.0)


def hdl_64e() -> Sensor:
    """Return a Velodyne HDL-64E: 64 beams in two blocks, +2 to -24.8 degrees, 120 m.

    Returns
    -------
    Sensor
    """
    upper = np.linspace(2.0, 2.0 - 31.0 / 3.0, 32)
    lower = np.linspace(-8.83, -24.8, 32)
    elevations = np.concatenate([upper, lower])
    # Calibrated angles deviate from nominal ones by a few hundredths of a degree.
    elevations[1:-1] += 0.08 * (_scatter(62) - 0.5)
    # Neighbouring beams are in different columns of the optical block.
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
    """Return a Velodyne HDL-32E: 32 beams, +10.67 to -30.67 degrees, 70 m.

    Returns
    -------
    Sensor
    """
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
    """Return an Ouster OS1-64: 64 beams over +-16.6 degrees in four staggered columns, 120 m.

    Returns
    -------
    Sensor
    """
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
"""Functions that return the sensors, by name."""


def unit_vectors(
    azimuths: NDArray[np.float64], elevations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (..., 3) unit vectors of directions [rad]: azimuths from x to y, elevations up."""
    horizontal = np.cos(elevations)
    return np.stack(
        [horizontal * np.cos(azimuths), horizontal * np.sin(azimuths), np.sin(elevations)], axis=-1
    )


def _scatter(count: int) -> Vector:
    """Return fixed, evenly distributed numbers in [0, 1)."""
    return (np.arange(1, count + 1, dtype=np.float64) * _GOLDEN) % 1.0


def _radians(degrees: Vector) -> tuple[float, ...]:
    return tuple(float(angle) for angle in np.radians(degrees))
