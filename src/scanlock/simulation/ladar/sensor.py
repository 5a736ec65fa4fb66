"""A range-imaging ladar with a mirror of many facets, and its way from ranges to points.

Modelled on the unit that Madhavan and Messina (2003) registered scans of. From the paper: 32 rows
by 180 columns in 16 facets, 20 degrees high, on a platform that tilts by +-30 degrees, facets
that come back empty, and the use of mount and calibration to get coordinates. The paper is silent
on the rest, which is ours: 90 degrees across, two neighbouring rows a facet, ten frames a
second, reach, noise, resolution and how returns are lost.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from scanlock.arrays import Matrix, Points, Vector
from scanlock.errors import (
    InvalidInput,
    require_at_least,
    require_count,
    require_fraction,
    require_positive,
)
from scanlock.simulation.ladar.mount import PanTiltMount
from scanlock.simulation.scenes.terrain import ramp

_SHARPEST = 1e-9
"""Cosines and widths below this count as this, which no return can tell from zero."""

_FACET_OFFSETS = (
    0.02, -0.04, 0.05, -0.01, 0.03, -0.05, 0.0, 0.04, -0.02, 0.01, -0.03, 0.05, -0.04, 0.02, 0.0,
    -0.01,
)  # fmt: skip
"""How far up the facets of the usual unit look beyond the nominal [deg]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FacetLadar:
    """A ladar that takes range images, one facet of its mirror after the other from the top.

    Its frame has x ahead through the middle of the image, y to the left and z up. Row 0 is the
    top of the image and column 0 its left. A facet sweeps its rows once from left to right.
    """

    rows: int = 32
    """Height of the image; each facet has as many rows as every other."""
    columns: int = 180
    """Width of the image."""
    facet_offsets: tuple[float, ...] = tuple(math.radians(angle) for angle in _FACET_OFFSETS)
    """Calibration: how far up each facet looks beyond the nominal [rad]; one entry a facet."""
    width: float = math.radians(90.0)
    """Field of view across [rad]."""
    height: float = math.radians(20.0)
    """Field of view up and down [rad]."""
    rate: float = 10.0
    """Frames a second [Hz]."""
    frame_time: float = 0.1
    """How long a frame takes [s]; the platform moves in what is left until the next."""
    min_range: float = 1.0
    """Nearer returns are lost [m]."""
    max_range: float = 60.0
    """Reach to a surface that faces the ladar [m]."""
    range_noise: float = 0.035
    """Standard deviation of a range [m]."""
    range_resolution: float = 0.02
    """Readings are multiples of this [m]; 0 leaves them as they are."""
    range_scale: float = 1.002
    """Calibration: metres per metre of a reading."""
    range_offset: float = 0.12
    """Calibration: the range of a reading of zero [m]."""
    grazing: float = 0.25
    """The reach shrinks with the cosine of incidence to this power."""
    fading: float = 0.2
    """Returns thin out from this fraction short of the reach to as far beyond it."""
    dropout: float = 0.02
    """Share of pulses lost whatever they meet."""
    plant_loss: float = 0.12
    """Share of the pulses lost on leaves and grass, which fill a beam in part only."""
    facet_loss: float = 0.02
    """Chance that a facet of a frame comes back empty."""

    def __post_init__(self) -> None:
        require_count("rows", self.rows, minimum=2)
        require_count("columns", self.columns, minimum=2)
        if not self.facet_offsets or self.rows % len(self.facet_offsets):
            raise InvalidInput(
                "facet_offsets must have one entry a facet, and the rows be shared out evenly, "
                f"got {len(self.facet_offsets)} for {self.rows} rows"
            )
        for name in ("width", "height"):
            require_positive(name, getattr(self, name), unit="rad")
        require_positive("rate", self.rate, unit="Hz")
        require_positive("frame_time", self.frame_time, unit="s")
        if self.frame_time > 1.0 / self.rate:
            raise InvalidInput(
                f"frame_time must not exceed {1.0 / self.rate} s at {self.rate} frames a second, "
                f"got {self.frame_time} s"
            )
        if not (np.diff(self.elevations()) < 0.0).all():
            raise InvalidInput(
                "facet_offsets must be finite and leave the rows in order from the top, got "
                f"{self.facet_offsets}"
            )
        self._check_ranges()

    def _check_ranges(self) -> None:
        require_at_least("min_range", self.min_range, 0.0, unit="m")
        require_positive("max_range", self.max_range, unit="m")
        if self.max_range <= self.min_range:
            raise InvalidInput(
                f"max_range must exceed min_range, got {self.max_range} <= {self.min_range} m"
            )
        for name in ("range_noise", "range_resolution"):
            require_at_least(name, getattr(self, name), 0.0, unit="m")
        require_positive("range_scale", self.range_scale)
        if not math.isfinite(self.range_offset):
            raise InvalidInput(f"range_offset must be finite, got {self.range_offset} m")
        require_at_least("grazing", self.grazing, 0.0)
        for name in ("fading", "dropout", "plant_loss", "facet_loss"):
            require_fraction(name, getattr(self, name))

    @property
    def facets(self) -> int:
        """How many facets a frame has."""
        return len(self.facet_offsets)

    @property
    def rows_per_facet(self) -> int:
        """How many neighbouring rows of the image come from one facet."""
        return self.rows // self.facets

    def elevations(self) -> Vector:
        """Return how far up each row looks, one a row [rad]."""
        nominal = self.height * (0.5 - (np.arange(self.rows) + 0.5) / self.rows)
        return nominal + np.repeat(self.facet_offsets, self.rows_per_facet)

    def azimuths(self) -> Vector:
        """Return how far left each column looks, (columns,) [rad]."""
        return self.width * (0.5 - (np.arange(self.columns) + 0.5) / self.columns)

    def directions(self) -> NDArray[np.float64]:
        """Return the unit vectors (r, c, 3) of an image in the frame of the ladar."""
        elevation, azimuth = np.meshgrid(self.elevations(), self.azimuths(), indexing="ij")
        level = np.cos(elevation)
        return np.stack(
            [level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)], axis=2
        )

    def firing_times(self) -> Matrix:
        """Return when each facet fires at each column, (facets, columns) [s] into the frame."""
        order = np.arange(self.facets * self.columns, dtype=np.float64)
        return (order * (self.frame_time / order.size)).reshape(self.facets, self.columns)

    def detection(self, distances: Vector, cosines: Vector) -> Vector:
        """Return the chance (n,) that a pulse comes back from so far at such an incidence."""
        share = np.asarray(distances) / (
            self.max_range * np.maximum(cosines, _SHARPEST) ** self.grazing
        )
        fading = max(self.fading, _SHARPEST)
        chance = 1.0 - ramp(share, 1.0 - fading, 1.0 + fading)
        seen = (distances >= self.min_range) & (distances <= self.max_range)
        return np.where(seen, chance * (1.0 - self.dropout), 0.0)

    def readings(self, distances: Vector) -> Vector:
        """Return what the ladar reports for distances [m], by its scale, offset and resolution."""
        readings = (np.asarray(distances) - self.range_offset) / self.range_scale
        if self.range_resolution > 0.0:
            readings = np.rint(readings / self.range_resolution) * self.range_resolution
        return readings


def points_from_ranges(
    ranges: ArrayLike, ladar: FacetLadar, mount: PanTiltMount, *, pan: float, tilt: float
) -> NDArray[np.float64]:
    """Return the points of a range image in the frame of the vehicle.

    Parameters
    ----------
    ranges : (r, c) [m]
        Readings; empty where not finite or not positive.
    ladar, mount : FacetLadar, PanTiltMount
        Angles and calibration of the ladar, and where it is fixed.
    pan, tilt : float [rad]
        Readings of the platform.

    Returns
    -------
    (r, c, 3) [m]
        NaN where the image is empty.

    Raises
    ------
    InvalidInput
        An image of another shape, or a platform beyond its limits.
    """
    image = np.asarray(ranges, np.float64)
    if image.shape != (ladar.rows, ladar.columns):
        raise InvalidInput(
            f"ranges must have shape {(ladar.rows, ladar.columns)}, got {image.shape}"
        )
    empty = ~(np.isfinite(image) & (image > 0.0))
    metres = np.where(empty, np.nan, ladar.range_scale * image + ladar.range_offset)
    return mount.vehicle_from_sensor(pan, tilt).apply(metres[..., None] * ladar.directions())


def ranges_from_points(
    points: Points, ladar: FacetLadar, mount: PanTiltMount, *, pan: float, tilt: float
) -> Matrix:
    """Return the range image of points in the frame of the vehicle; see `points_from_ranges`.

    Each point falls on the pixel whose beam is nearest in both angles; of several in one pixel
    the nearest counts, and those outside of the field of view are left out. NaN where empty.
    """
    local = mount.vehicle_from_sensor(pan, tilt).inverse().apply(points).reshape(-1, 3)
    local = local[np.isfinite(local).all(axis=1)]
    metres = np.linalg.norm(local, axis=1)
    level = np.hypot(local[:, 0], local[:, 1])
    # Both run from high to low, so that they are searched from behind.
    row = _nearest(-ladar.elevations(), -np.arctan2(local[:, 2], level))
    column = _nearest(-ladar.azimuths(), -np.arctan2(local[:, 1], local[:, 0]))
    inside = (row >= 0) & (column >= 0)
    readings = (metres[inside] - ladar.range_offset) / ladar.range_scale
    image = np.full((ladar.rows, ladar.columns), np.inf)
    np.minimum.at(image, (row[inside], column[inside]), readings)
    image[np.isinf(image)] = np.nan
    return image


def _nearest(angles: Vector, wanted: Vector) -> NDArray[np.int64]:
    """Return which of some rising angles is nearest to each (n,) angle; -1 beyond them."""
    edges = 0.5 * (angles[1:] + angles[:-1])
    outer = np.concatenate([2.0 * angles[:1] - edges[:1], edges, 2.0 * angles[-1:] - edges[-1:]])
    index = np.searchsorted(outer, wanted, side="right") - 1
    return np.where(index < len(angles), index, -1).astype(np.int64)
