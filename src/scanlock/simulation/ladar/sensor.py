"""Range-imaging ladar with a multi-facet mirror, and conversion between ranges and points.

The model follows the unit in Madhavan and Messina (2003): 32 rows by 180 columns in 16 facets, 20
degrees high, on a platform that tilts by +-30 degrees, with facets that are sometimes empty, and
coordinates computed from mount and calibration. All other values are ours: 90 degrees of width, two
neighbouring rows per facet, ten frames per second, range, noise, resolution and lost returns.
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
from scanlock.simulation.sensors import unit_vectors
from scanlock.simulation.terrain.waves import smoothstep

_MIN_COSINE = 1e-9
"""Lower bound of cosines and of fading widths, to avoid a division by zero."""

_FACET_OFFSETS = (
    0.02, -0.04, 0.05, -0.01, 0.03, -0.05, 0.0, 0.04, -0.02, 0.01, -0.03, 0.05, -0.04, 0.02, 0.0,
    -0.01,
)  # fmt: skip
"""Deviations of the facets of the default unit from their nominal elevation [deg]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class FacetLadar:
    """A ladar that records range images, facet by facet from the top.

    Its frame has x ahead through the centre of the image, y to the left and z up. Row 0 is the
    top of the image and column 0 its left. Each facet sweeps its rows once from left to right.
    """

    rows: int = 32
    """Number of image rows, divided equally among the facets."""
    columns: int = 180
    """Number of image columns."""
    facet_offsets: tuple[float, ...] = tuple(math.radians(angle) for angle in _FACET_OFFSETS)
    """Calibration: deviation of each facet from its nominal elevation, positive upwards [rad]."""
    width: float = math.radians(90.0)
    """Horizontal field of view [rad]."""
    height: float = math.radians(20.0)
    """Vertical field of view [rad]."""
    rate: float = 10.0
    """Frames per second [Hz]."""
    frame_time: float = 0.1
    """Duration of a frame [s]; the platform moves between frames."""
    min_range: float = 1.0
    """Minimum range of a return [m]."""
    max_range: float = 60.0
    """Maximum range of a return at perpendicular incidence [m]."""
    range_noise: float = 0.035
    """Standard deviation of the range [m]."""
    range_resolution: float = 0.02
    """Resolution of the readings [m]; 0 for no rounding."""
    range_scale: float = 1.002
    """Calibration: scale of the range over the reading."""
    range_offset: float = 0.12
    """Calibration: range at a reading of zero [m]."""
    grazing: float = 0.25
    """Exponent of the cosine of incidence in the detection range."""
    fading: float = 0.2
    """Half width of the interval in which detection fades, as a fraction of the detection range."""
    dropout: float = 0.02
    """Ratio of pulses lost independent of the surface."""
    plant_loss: float = 0.12
    """Ratio of pulses lost on leaves and grass, which cover only part of a beam."""
    facet_loss: float = 0.02
    """Probability that a facet of a frame is empty."""

    def __post_init__(self) -> None:
        require_count("rows", self.rows, minimum=2)
        require_count("columns", self.columns, minimum=2)
        if not self.facet_offsets or self.rows % len(self.facet_offsets):
            raise InvalidInput(
                "facet_offsets must have one entry per facet, and rows be divisible by their "
                f"number, got {len(self.facet_offsets)} for {self.rows} rows"
            )
        for name in ("width", "height"):
            require_positive(name, getattr(self, name), unit="rad")
        require_positive("rate", self.rate, unit="Hz")
        require_positive("frame_time", self.frame_time, unit="s")
        if self.frame_time > 1.0 / self.rate:
            raise InvalidInput(
                f"frame_time must be at most {1.0 / self.rate} s at {self.rate} frames per second, "
                f"got {self.frame_time} s"
            )
        if not (np.diff(self.elevations()) < 0.0).all():
            raise InvalidInput(
                "facet_offsets must be finite and keep the rows in descending order, got "
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
        """Number of facets."""
        return len(self.facet_offsets)

    @property
    def rows_per_facet(self) -> int:
        """Number of neighbouring image rows per facet."""
        return self.rows // self.facets

    def elevations(self) -> Vector:
        """Return the (rows,) elevations of the image rows [rad]."""
        nominal = self.height * (0.5 - (np.arange(self.rows) + 0.5) / self.rows)
        return nominal + np.repeat(self.facet_offsets, self.rows_per_facet)

    def azimuths(self) -> Vector:
        """Return the (columns,) azimuths of the image columns, positive to the left [rad]."""
        return self.width * (0.5 - (np.arange(self.columns) + 0.5) / self.columns)

    def directions(self) -> NDArray[np.float64]:
        """Return the (r, c, 3) unit vectors of the pixels in the frame of the ladar."""
        elevation, azimuth = np.meshgrid(self.elevations(), self.azimuths(), indexing="ij")
        return unit_vectors(azimuth, elevation)

    def firing_times(self) -> Matrix:
        """Return the (facets, columns) times of firing, from the start of a frame [s]."""
        order = np.arange(self.facets * self.columns, dtype=np.float64)
        return (order * (self.frame_time / order.size)).reshape(self.facets, self.columns)

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
        relative_range = np.asarray(distances) / (
            self.max_range * np.maximum(cosines, _MIN_COSINE) ** self.grazing
        )
        fading = max(self.fading, _MIN_COSINE)
        probability = 1.0 - smoothstep(relative_range, 1.0 - fading, 1.0 + fading)
        in_range = (distances >= self.min_range) & (distances <= self.max_range)
        return np.where(in_range, probability * (1.0 - self.dropout), 0.0)

    def readings(self, distances: Vector) -> Vector:
        """Return the (n,) readings for distances [m]: with scale, offset and resolution applied."""
        readings = (np.asarray(distances) - self.range_offset) / self.range_scale
        if self.range_resolution > 0.0:
            readings = np.rint(readings / self.range_resolution) * self.range_resolution
        return readings


def points_from_ranges(
    ranges: ArrayLike, ladar: FacetLadar, mount: PanTiltMount, *, pan: float, tilt: float
) -> NDArray[np.float64]:
    """Compute the points of a range image, in the frame of the vehicle.

    Parameters
    ----------
    ranges : (r, c) [m]
        Readings; pixels that are not finite or not positive are empty.
    ladar, mount : FacetLadar, PanTiltMount
        Geometry and calibration of the ladar, and its mount.
    pan, tilt : float [rad]
        Readings of the platform.

    Returns
    -------
    (r, c, 3) [m]
        NaN for empty pixels.

    Raises
    ------
    InvalidInput
        An image of another shape, or a reading beyond the limits of the platform.
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
    """Compute the range image of points in the frame of the vehicle.

    Each point belongs to the pixel with the nearest beam in both angles. The nearest point of each
    pixel is used, and points outside of the field of view are ignored.

    Parameters
    ----------
    points : (n, 3) [m]
    ladar, mount, pan, tilt
        As for `points_from_ranges`.

    Returns
    -------
    (r, c) [m]
        Readings; NaN for empty pixels.

    Raises
    ------
    InvalidInput
        A reading beyond the limits of the platform.
    """
    local = mount.vehicle_from_sensor(pan, tilt).inverse().apply(points).reshape(-1, 3)
    local = local[np.isfinite(local).all(axis=1)]
    metres = np.linalg.norm(local, axis=1)
    horizontal = np.hypot(local[:, 0], local[:, 1])
    # Negated, since elevations and azimuths descend and the search needs ascending angles.
    row = _nearest(-ladar.elevations(), -np.arctan2(local[:, 2], horizontal))
    column = _nearest(-ladar.azimuths(), -np.arctan2(local[:, 1], local[:, 0]))
    inside = (row >= 0) & (column >= 0)
    readings = (metres[inside] - ladar.range_offset) / ladar.range_scale
    image = np.full((ladar.rows, ladar.columns), np.inf)
    np.minimum.at(image, (row[inside], column[inside]), readings)
    image[np.isinf(image)] = np.nan
    return image


def _nearest(angles: Vector, queries: Vector) -> NDArray[np.int64]:
    """Return the index of the nearest of ascending angles for each query; -1 beyond them."""
    edges = 0.5 * (angles[1:] + angles[:-1])
    outer = np.concatenate([2.0 * angles[:1] - edges[:1], edges, 2.0 * angles[-1:] - edges[-1:]])
    index = np.searchsorted(outer, queries, side="right") - 1
    return np.where(index < len(angles), index, -1).astype(np.int64)
