"""Lidars that sweep rows of beams about their axis: directions, detection range and noise."""

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

_MIN_COSINE = 1e-9
"""Lower bound of cosines and of fading widths, to avoid a division by zero."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Sensor:
    """A multi-beam lidar that sweeps clockwise, seen from above.

    The frame of the sensor has x ahead, y to the left and z up. The middle of a sweep is straight
    ahead, so that of a spinning sensor begins and ends behind it.
    """

    name: str
    """Name of the sensor."""
    elevations: tuple[float, ...]
    """Angle of each beam above the x-y plane [rad], by ring."""
    azimuth_offsets: tuple[float, ...]
    """Angle of each beam to the left of the firing direction [rad]."""
    azimuth_steps: int
    """Number of firings per sweep; each fires every beam once."""
    rate: float
    """Sweeps per second [Hz]."""
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
    width: float = 2.0 * math.pi
    """Angle that a sweep covers [rad]; a full turn for a spinning sensor."""

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
        if not 0.0 < self.width <= 2.0 * math.pi:
            raise InvalidInput(
                f"width must be an angle above 0 and up to a full turn, got {self.width} rad"
            )

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
        heading = 0.5 * self.width - self.width * np.arange(self.azimuth_steps) / self.azimuth_steps
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


def unit_vectors(
    azimuths: NDArray[np.float64], elevations: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the (..., 3) unit vectors of directions [rad]: azimuths from x to y, elevations up."""
    horizontal = np.cos(elevations)
    return np.stack(
        [horizontal * np.cos(azimuths), horizontal * np.sin(azimuths), np.sin(elevations)], axis=-1
    )
