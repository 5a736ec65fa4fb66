"""Ground segmentation: chi of Das et al. 2013, section IV, in a corrected and the published form.

The prototype of a polar cell is its lowest point. In the corrected form, a base plane through the
prototypes levels the cloud, and a base surface of planar patches grows from it. One Gaussian
process per sector about that surface grows by incremental sample consensus (INSAC). The height
above the model classifies every point.
"""

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from scanlock.arrays import Matrix, Points, Vector, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.ground.model import extent
from scanlock.kernels.ground.point_passes import classify_points, rotated_points
from scanlock.segmentation.ground.attitude import Z_AXIS, angle_between, dominant_up, is_reliable
from scanlock.segmentation.ground.base import fit_base_surface
from scanlock.segmentation.ground.gaussian_process import (
    GaussianProcess,
    Insac,
    SectorInterpolation,
)
from scanlock.segmentation.ground.model import grow_ground, knots_of_model
from scanlock.segmentation.ground.plane import BasePlane, fit_base_plane
from scanlock.segmentation.ground.prototypes import Prototypes
from scanlock.segmentation.ground.published import knots_of_prototypes, lowest_seeds
from scanlock.segmentation.ground.result import Ground as Ground
from scanlock.segmentation.ground.result import GroundStatus as GroundStatus

_MIN_PROTOTYPES = 10
"""Minimum number of ground prototypes (ours)."""

_MIN_BREADTH = 0.5
"""Minimum standard deviation of the ground along both horizontal axes [m] (ours).

The foot of a wall is a line, a step of a staircase a narrow strip.
"""

_MIN_LEVELLING_SUPPORT = 0.2
"""Minimum support of a base plane that levels the cloud (ours)."""

_MAX_CORRECTION = math.radians(45.0)
"""Largest angle between the base plane and the assumed horizontal plane [rad] (ours)."""

_MAX_FRACTION = 0.95
"""Maximum fraction of the points on a ground at any attitude (ours)."""

_SENSOR_PLANE = read_only(np.array([0.0, 0.0, 1.0, 0.0]))
"""Base plane of the published form: horizontal, at the height of the sensor."""


class GroundDetector(Protocol):
    """Ground segmentation of one scan, chi."""

    def find(self, cloud: PointCloud) -> Ground:
        """Find the ground of a cloud whose z axis is roughly upwards."""
        ...


@dataclass(frozen=True, kw_only=True, slots=True)
class GroundFinder:
    """Settings of ground segmentation in the corrected form, which needs no sensor height."""

    grid: PolarGrid = field(
        default_factory=lambda: PolarGrid(
            sectors=180, max_range=100.0, first_width=0.5, growth=1.03
        )
    )
    """Sectors and range bins; the width of bins grows, since returns get sparse (ours)."""

    insac: Insac = field(default_factory=Insac)
    """Gaussian process of each sector about the base surface, and its growth."""

    height_threshold: float = 0.25
    """Distance from the modelled ground below which a point is ground [m], T_g (ours)."""

    max_seed_height: float = 0.3
    """Largest distance of a seed from the base surface [m] (ours)."""

    max_seed_range: float = math.inf
    """Largest range of a seed [m]."""

    min_points: int = 1
    """Minimum number of points of a cell with a prototype."""

    max_tilt: float = math.radians(45.0)
    """Largest angle between the ground normal and the z axis [rad].

    Above 45 degrees, the dominant planes of the cloud are candidates for the ground as well.
    Without a ground that can be a wall or, upside down, a ceiling.
    """

    level_tilt: float = math.radians(5.0)
    """Angle between the ground normal and the z axis above which the cloud is levelled [rad]."""

    min_support: float = 0.1
    """Minimum fraction of the prototypes that are ground (ours)."""

    min_sharpness: float = 0.6
    """Minimum fraction of the points near the ground that are ground (ours).

    Points are near within three `height_threshold`. Near a surface most of them are within one;
    walls, foliage and noise extend further.
    """

    def __post_init__(self) -> None:
        _require_thresholds(self)
        require_fraction("min_support", self.min_support)
        require_fraction("min_sharpness", self.min_sharpness)
        if not 0 < self.level_tilt <= self.max_tilt <= math.pi:
            raise InvalidInput(
                "level_tilt and max_tilt must satisfy 0 < level_tilt <= max_tilt <= pi, got "
                f"{self.level_tilt} and {self.max_tilt} rad"
            )

    def find(self, cloud: PointCloud) -> Ground:
        """Find the ground of a cloud whose z axis is upwards within `max_tilt`.

        A cloud without ground raises nothing; see `Ground.status` and `Ground.reason`.
        """
        upright = self._find_about(cloud, np.eye(3))
        if self.max_tilt <= _MAX_CORRECTION or is_reliable(upright):
            return upright
        up = dominant_up(cloud.measured_points, upright)
        if up is None or angle_between(up, Z_AXIS) > self.max_tilt:
            return upright
        ground = self._find_about(cloud, rotation_onto_z(up))
        # Nothing would remain above a wall that is the whole scene.
        if ground.status is GroundStatus.NONE or ground.is_ground.mean() > _MAX_FRACTION:
            return upright
        return ground

    def _find_about(self, cloud: PointCloud, rotation: Matrix) -> Ground:
        """Find the ground of a cloud that is roughly upright after a rotation."""
        level = self._levelled(cloud, rotation)
        if isinstance(level, str):
            return Ground.none(len(cloud), level)
        prototypes, plane = level.prototypes, level.plane
        base = fit_base_surface(level.points, prototypes, plane, self.grid)
        accepted, modelled = grow_ground(
            prototypes,
            plane,
            base,
            self.insac,
            max_seed_height=self.max_seed_height,
            max_seed_range=self.max_seed_range,
        )
        height, is_ground, is_below, near, close = classify_points(
            read_only(level.points),
            prototypes.cell_of_point,
            plane.coefficients,
            knots_of_model(prototypes, modelled, base.sharp, self.height_threshold),
            self.height_threshold,
        )
        count, breadth, sectors = extent(prototypes.points, read_only(accepted), prototypes.starts)
        if objection := self._objection(count, len(accepted), breadth, close, near):
            return Ground.none(len(cloud), objection)
        is_tilted = level.tilt > self.level_tilt
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.TILTED if is_tilted else GroundStatus.FOUND,
            reason=f"{count / len(accepted):.0%} of the lowest points of all cells are ground"
            + (f", {math.degrees(level.tilt):.0f} degrees off the z axis" if is_tilted else ""),
            plane=np.append(level.up, plane.offset),
            sensor_height=math.nan if cloud.origin.any() else plane.offset,
            sectors=sectors,
        )

    def _levelled(self, cloud: PointCloud, rotation: Matrix) -> "_LevelCloud | str":
        """Level a rotated cloud by its base plane; return the reason where that is impossible."""
        points, max_tilt = cloud.points, min(self.max_tilt, _MAX_CORRECTION)
        assumed_up = rotation[2]
        if assumed_up[2] < 1.0:
            points = rotated_points(read_only(points), read_only(rotation))
        prototypes = Prototypes.of(points, self.grid, self.min_points)
        plane = fit_base_plane(prototypes.points, max_tilt=max_tilt)
        # The second rotation corrects the error of prototypes found in a tilted frame.
        for _ in range(2):
            if (
                plane is None
                or plane.tilt <= self.level_tilt
                or plane.support < _MIN_LEVELLING_SUPPORT
            ):
                break
            levelling = rotation_onto_z(plane.normal)
            points = rotated_points(read_only(points), read_only(levelling))
            rotation = levelling @ rotation
            prototypes = Prototypes.of(points, self.grid, self.min_points)
            plane = fit_base_plane(prototypes.points, max_tilt=max_tilt)
        if len(prototypes.points) < _MIN_PROTOTYPES:
            max_range = cloud.scale * self.grid.max_range
            return (
                f"only {len(prototypes.points)} cells within {max_range:g} m of the origin contain "
                "points"
            )
        if plane is None:
            return "no plane fits the lowest points"
        level = _LevelCloud(points, rotation.T @ plane.normal, prototypes, plane)
        correction = angle_between(level.up, assumed_up)
        if correction > max_tilt:
            degrees = math.degrees(correction)
            return f"the plane of the lowest points is {degrees:.0f} degrees off the z axis"
        return level

    def _objection(self, count: int, prototypes: int, breadth: float, close: int, near: int) -> str:
        """Return the reason why a model is not ground; empty if it is.

        It has `count` of the prototypes, with a standard deviation of at least `breadth` [m] in any
        horizontal direction. `close` and `near` are the numbers of points within one and three
        height thresholds.
        """
        if count < max(_MIN_PROTOTYPES, self.min_support * prototypes):
            return f"only {count} of the {prototypes} lowest points lie on a common surface"
        if breadth < _MIN_BREADTH:
            return "the lowest points lie along a line"
        if close < self.min_sharpness * near:
            return (
                f"only {close / near:.0%} of the points near the modelled ground lie on it, so it "
                "is not a surface"
            )
        return ""


@dataclass(frozen=True, slots=True, eq=False)
class _LevelCloud:
    """Levelled cloud.

    Attributes
    ----------
    points : (n, 3) [m]
        Levelled points.
    up : (3,)
        Normal of the base plane in the input frame.
    prototypes : Prototypes
        Lowest points of the cells of the levelled cloud.
    plane : BasePlane
        Base plane in the levelled frame.
    """

    points: Points
    up: Vector
    prototypes: Prototypes
    plane: BasePlane

    @property
    def tilt(self) -> float:
        """Angle between `up` and the z axis [rad]."""
        return angle_between(self.up, Z_AXIS)


@dataclass(frozen=True, kw_only=True, slots=True)
class PublishedGroundFinder:
    """Settings of ground segmentation as published: those of libwave, by its authors.

    Known defects: the variance threshold exceeds every variance, residuals of 2.7 m pass, and
    away from its prototypes the model returns to the height of the sensor.

    The public code differs in two points. It leaves some points without a label; here they are not
    ground. It also divides residuals by ``sqrt(noise + V**2)`` instead of ``sqrt(noise + V)``.
    """

    grid: PolarGrid = field(
        default_factory=lambda: PolarGrid(sectors=72, max_range=100.0, first_width=0.5)
    )
    """Sectors and range bins."""

    insac: Insac = field(
        default_factory=lambda: Insac(
            process=GaussianProcess(
                length_scale=10.0, signal_deviation=1.0, noise_deviation=math.sqrt(0.3)
            ),
            variance_threshold=5.0,
            residual_threshold=5.0,
            interpolation=SectorInterpolation(iterations=0),
        )
    )
    """Gaussian process of each sector about the height of the sensor, and its growth."""

    height_threshold: float = 0.3
    """Distance from the prototype of its cell below which a point is ground [m], T_g."""

    max_seed_height: float = 15.0
    """Largest distance of a seed from the height of the sensor [m]."""

    max_seed_range: float = 50.0
    """Largest range of a seed [m]."""

    max_seeds: int | None = 10
    """Maximum number of seeds of a sector, the lowest ones; None for all."""

    min_points: int = 6
    """Minimum number of points of a cell with a prototype."""

    def __post_init__(self) -> None:
        _require_thresholds(self)
        if self.max_seeds is not None:
            require_count("max_seeds", self.max_seeds, 2)

    def find(self, cloud: PointCloud) -> Ground:
        """Find the ground of a cloud whose z axis is upwards.

        A cloud without ground raises nothing; see `Ground.status` and `Ground.reason`.
        """
        prototypes = Prototypes.of(cloud.points, self.grid, self.min_points)
        seeds = lowest_seeds(
            prototypes,
            max_height=self.max_seed_height,
            max_range=self.max_seed_range,
            max_count=self.max_seeds,
        )
        heights = prototypes.points[:, 2]
        accepted, _, _ = self.insac.grow(prototypes.starts, prototypes.ranges, heights, seeds)
        _, _, sectors = extent(prototypes.points, read_only(accepted), prototypes.starts)
        if sectors == 0:
            return Ground.none(len(cloud), "no sector has the two seeds that its model needs")
        height, is_ground, is_below, _, _ = classify_points(
            cloud.points,
            prototypes.cell_of_point,
            _SENSOR_PLANE,
            knots_of_prototypes(prototypes, accepted, self.height_threshold),
            self.height_threshold,
        )
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.FOUND,
            reason=f"{sectors} sectors have a ground model; the published form checks no further",
            plane=np.array([0.0, 0.0, 1.0, math.nan]),
            sensor_height=math.nan,
            sectors=sectors,
        )


def _require_thresholds(settings: GroundFinder | PublishedGroundFinder) -> None:
    """Raise `InvalidInput` for invalid settings that both forms have."""
    require_positive("height_threshold", settings.height_threshold, unit="m")
    require_positive("max_seed_height", settings.max_seed_height, unit="m")
    if not settings.max_seed_range > 0:
        raise InvalidInput(f"max_seed_range must be positive, got {settings.max_seed_range} m")
    require_count("min_points", settings.min_points, 1)
