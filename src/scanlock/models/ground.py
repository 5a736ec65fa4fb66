"""Ground segmentation: chi of Das et al. 2013, section IV.

Polar prototypes, a base plane through them, one Gaussian process per sector about that plane
grown by incremental sample consensus (INSAC), and a decision for every point.
"""

import enum
import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Labels, Mask, Points, Vector, frozen
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import require_at_least, require_positive
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.ground import heights_above_model, lowest_in_cells
from scanlock.models.gaussian_process import GaussianProcess
from scanlock.models.ground_plane import BasePlane, fit_base_plane


class GroundStatus(enum.Enum):
    """Whether there is a ground to speak of."""

    FOUND = "found"
    """A ground, with the sensor's z axis close to its normal."""

    TILTED = "tilted"
    """A ground, found after turning the cloud upright; its own z axis is not up."""

    NONE = "none"
    """No believable ground; no point is called ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What is ground in a cloud, and where the ground lies.

    Attributes
    ----------
    is_ground : (n,)
        One answer for each row of ``cloud.points``.
    height : (n,) [m]
        Height above the modelled ground; NaN where nothing is modelled.
    status : GroundStatus
        Whether a ground was found.
    reason : str
        One sentence that says why.
    sensor_height : float [m]
        Height of the cloud's frame origin above the ground below it; NaN when unknown.
    up : (3,)
        Unit normal of the base plane in the frame of the cloud.
    tilt : float [rad]
        Angle between `up` and the z axis.
    sectors : int
        Sectors with a model of their own.
    """

    is_ground: Mask
    height: Vector
    status: GroundStatus
    reason: str
    sensor_height: float
    up: Vector
    tilt: float
    sectors: int

    def __post_init__(self) -> None:
        for array in (self.is_ground, self.height, self.up):
            frozen(array)


@dataclass(frozen=True, kw_only=True, slots=True)
class GroundFinder:
    """Finds the ground of one scan; the default corrects the published method."""

    grid: PolarGrid = field(
        default_factory=lambda: PolarGrid(
            sectors=180, max_range=100.0, first_width=0.5, growth=1.03
        )
    )
    """Sectors and range bins of the prototypes."""

    process: GaussianProcess = field(
        default_factory=lambda: GaussianProcess(
            length_scale=10.0, signal_deviation=0.5, noise_deviation=0.06
        )
    )
    """The ground of one sector about its mean function."""

    mean: Literal["plane", "zero"] = "plane"
    """Mean function of the process: the base plane, or height zero of the sensor's frame."""

    variance_limit: float = 0.09
    """A prototype joins where the variance of the model is below this, T_model [m^2]."""

    residual_limit: float = 3.0
    """A prototype joins within this many standard deviations of the model, T_data."""

    height_limit: float = 0.2
    """A point within this height of the modelled ground is ground, T_g [m]."""

    seed_height: float = 0.3
    """A prototype this close to the base plane is a seed [m]."""

    min_points: int = 1
    """A cell with fewer points has no prototype."""

    max_tilt: float = math.radians(45.0)
    """No ground is looked for beyond this angle from the z axis [rad]."""

    level_tilt: float = math.radians(5.0)
    """Beyond this angle the cloud is turned upright before its ground is modelled [rad]."""

    min_support: float = 0.15
    """Share of the prototypes that must lie on the base plane."""

    def __post_init__(self) -> None:
        require_positive("variance_limit", self.variance_limit, unit="m^2")
        require_positive("residual_limit", self.residual_limit)
        require_positive("height_limit", self.height_limit, unit="m")
        require_positive("seed_height", self.seed_height, unit="m")
        require_at_least("min_points", self.min_points, 1)

    def find(self, cloud: PointCloud) -> Ground:
        """Return the ground of a cloud whose z axis points roughly upwards."""
        points, rotation = cloud.points, np.eye(3)
        prototypes = self._prototypes(points)
        plane = self._base_plane(prototypes)
        for _ in range(2):
            if plane is None or _tilt(plane.normal) <= self.level_tilt:
                break
            upright = _turn_up(plane.normal)
            points, rotation = points @ upright.T, upright @ rotation
            prototypes = self._prototypes(points)
            plane = self._base_plane(prototypes)
        if plane is None:
            return _no_ground(cloud, "no plane fits the lowest points")
        if plane.support < self.min_support:
            return _no_ground(
                cloud, f"only {plane.support:.0%} of the lowest points lie on a common plane"
            )
        up = rotation.T @ plane.normal
        model = self._model(prototypes, plane)
        height = heights_above_model(points, prototypes.cells, plane.coefficients, *model)
        is_ground = np.abs(height) < self.height_limit
        tilt = _tilt(up)
        status = GroundStatus.FOUND if tilt <= self.level_tilt else GroundStatus.TILTED
        return Ground(
            is_ground=is_ground,
            height=height,
            status=status,
            reason=f"{plane.support:.0%} of the lowest points lie on the base plane",
            sensor_height=math.nan if cloud.origin.any() else plane.offset,
            up=up,
            tilt=tilt,
            sectors=int(np.isfinite(model[1].reshape(self.grid.sectors, -1)).any(axis=1).sum()),
        )

    def _prototypes(self, points: Points) -> "_Prototypes":
        cells = self.grid.cells(points)
        cell_count = self.grid.sectors * self.grid.bins
        lowest, count = lowest_in_cells(points, cells, cell_count)
        used = np.flatnonzero(count >= self.min_points)
        low = points[lowest[used]]
        starts = np.searchsorted(used, np.arange(self.grid.sectors + 1) * self.grid.bins)
        return _Prototypes(cells, used, low, np.hypot(low[:, 0], low[:, 1]), starts, cell_count)

    def _base_plane(self, prototypes: "_Prototypes") -> BasePlane | None:
        return fit_base_plane(prototypes.points, gate=0.2, gate_slope=0.02, max_tilt=self.max_tilt)

    def _model(
        self, prototypes: "_Prototypes", plane: BasePlane
    ) -> tuple[Vector, Vector, Vector, Vector]:
        heights = plane.heights(prototypes.points)
        _, mean, variance = self.process.consensus(
            prototypes.starts,
            prototypes.ranges,
            heights,
            np.abs(heights) < self.seed_height,
            variance_limit=self.variance_limit,
            residual_limit=self.residual_limit,
        )
        mean[variance >= self.variance_limit] = np.nan
        ranges, cells = prototypes.ranges, prototypes.used
        with np.errstate(invalid="ignore"):
            slopes = np.diff(mean) / np.maximum(np.diff(ranges), 1e-3)
        slopes[np.diff(cells // self.grid.bins) != 0] = np.nan
        slopes = np.concatenate([[np.nan], slopes, [np.nan]])
        slope_in = np.where(np.isfinite(slopes[:-1]), slopes[:-1], 0.0)
        slope_out = np.where(np.isfinite(slopes[1:]), slopes[1:], 0.0)
        full = np.full((4, prototypes.cell_count), np.nan)
        full[:, cells] = ranges, mean, slope_in, slope_out
        return full[0], full[1], full[2], full[3]


@dataclass(frozen=True, slots=True, eq=False)
class _Prototypes:
    """The lowest point of each occupied cell, sector by sector and outwards."""

    cells: Labels
    used: Labels
    points: Points
    ranges: Vector
    starts: Labels
    cell_count: int


def _tilt(normal: Vector) -> float:
    return float(np.arctan2(np.hypot(normal[0], normal[1]), normal[2]))


def _turn_up(normal: Vector) -> Points:
    axis = np.array([normal[1], -normal[0], 0.0])
    sine = float(np.linalg.norm(axis))
    if sine == 0.0:
        return np.eye(3)
    return exp_rotation(axis / sine * math.atan2(sine, float(normal[2])))


def _no_ground(cloud: PointCloud, reason: str) -> Ground:
    n = len(cloud)
    return Ground(
        is_ground=np.zeros(n, dtype=np.bool_),
        height=np.full(n, np.nan),
        status=GroundStatus.NONE,
        reason=reason,
        sensor_height=math.nan,
        up=np.array([0.0, 0.0, 1.0]),
        tilt=math.nan,
        sectors=0,
    )
