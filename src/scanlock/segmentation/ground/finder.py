"""Ground segmentation: chi of Das et al. 2013, section IV.

The lowest point of each polar cell is a prototype. A base plane through the prototypes levels
the cloud, a base surface of patches grows from it, and about that surface one Gaussian process
per sector grows by incremental sample consensus (INSAC). Every point is decided.
"""

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Matrix, Points, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.ground.model import extent
from scanlock.kernels.ground.point_passes import split_by_knots, turned_points
from scanlock.segmentation.ground.base import fit_base_surface
from scanlock.segmentation.ground.gaussian_process import GaussianProcess, Lending
from scanlock.segmentation.ground.model import knots_of_model, modelled_heights
from scanlock.segmentation.ground.plane import BasePlane, fit_base_plane
from scanlock.segmentation.ground.prototypes import Prototypes
from scanlock.segmentation.ground.published import published_knots
from scanlock.segmentation.ground.result import Ground as Ground
from scanlock.segmentation.ground.result import GroundStatus as GroundStatus

_LEAST_PROTOTYPES = 10
"""Fewer low points on the base plane are no evidence of a ground (ours)."""

_LEAST_BREADTH = 0.5
"""Standard deviation [m] that the ground must spread along both its axes (ours): the foot of a
wall is a line, a step of a stair a narrow strip."""

_UPWARDS = np.array([0.0, 0.0, 1.0, 0.0])
"""The plane of the published form: z at the height of the sensor."""

_FIRM_SUPPORT = 0.2
"""Share of the lowest points on the base plane from which its tilt is believed (ours)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class GroundFinder:
    """Finds the ground of one scan.

    ``GroundFinder()`` is the corrected method, which needs no sensor height;
    ``GroundFinder.das2013()`` the method with its published constants and defects.
    """

    form: Literal["corrected", "published"] = "corrected"
    """Corrected: processes about a base surface, uncertain sectors helped by their neighbours,
    points decided against the model. Published: processes about the height of the sensor, points
    decided against the lowest one of their cell."""

    grid: PolarGrid = field(
        default_factory=lambda: PolarGrid(
            sectors=180, max_range=100.0, first_width=0.5, growth=1.03
        )
    )
    """Sectors and range bins; one prototype per cell. Bins grow, as returns thin out (ours)."""

    process: GaussianProcess = field(default_factory=GaussianProcess)
    """The ground of one sector about its mean function."""

    lending: Lending = field(default_factory=Lending)
    """How sectors whose ground is hidden take heights from their neighbours. Corrected form
    only."""

    variance_limit: float = 0.04
    """A prototype joins, and a height counts as known, where the variance of the model is below
    this [m^2], T_model (ours; the published 5 accepts always)."""

    residual_limit: float = 3.0
    """A prototype joins within this many standard deviations of the model, T_data (ours)."""

    height_limit: float = 0.25
    """A point this close to the modelled ground is ground [m], T_g (ours; 0.3 published)."""

    seed_height: float = 0.3
    """A prototype this close to the mean function may be a seed [m] (ours)."""

    seed_range: float = math.inf
    """A prototype within this range may be a seed [m]."""

    seed_count: int | None = None
    """Most seeds of a sector, the lowest; None takes all. Published form only."""

    min_points: int = 1
    """A cell with fewer points has no prototype."""

    max_tilt: float = math.radians(45.0)
    """No ground is looked for beyond this angle between its normal and the z axis [rad]."""

    level_tilt: float = math.radians(5.0)
    """Beyond this angle the cloud is turned upright before its ground is modelled [rad]."""

    min_support: float = 0.1
    """Share of the prototypes that must be ground (ours)."""

    min_sharpness: float = 0.6
    """Share of the points within three `height_limit` of the ground that must lie within one
    (ours): a ground is a surface, while walls, leaves and noise go on above it."""

    def __post_init__(self) -> None:
        if self.form not in ("corrected", "published"):
            raise InvalidInput(f"form must be 'corrected' or 'published', got {self.form!r}")
        require_positive("variance_limit", self.variance_limit, unit="m^2")
        require_positive("residual_limit", self.residual_limit)
        require_positive("height_limit", self.height_limit, unit="m")
        require_positive("seed_height", self.seed_height, unit="m")
        if not self.seed_range > 0:
            raise InvalidInput(f"seed_range must be positive, got {self.seed_range} m")
        if self.seed_count is not None:
            require_count("seed_count", self.seed_count, 2)
        require_count("min_points", self.min_points, 1)
        require_fraction("min_support", self.min_support)
        require_fraction("min_sharpness", self.min_sharpness)
        if not 0 < self.level_tilt <= self.max_tilt < math.pi / 2:
            raise InvalidInput(
                "level_tilt and max_tilt must satisfy 0 < level_tilt <= max_tilt < pi/2, got "
                f"{self.level_tilt} and {self.max_tilt} rad"
            )

    @classmethod
    def das2013(cls) -> "GroundFinder":
        """Return the published method: settings of libwave, by the authors of Das et al. 2013.

        Its defects are part of it: the variance gate never closes, residuals of 2.7 m pass,
        and away from its prototypes the model drifts back to the height of the sensor. Unlike
        the public code it answers for every point (what that code leaves out is not ground),
        and its gate divides by ``sqrt(noise + V)``, where that code squares V, at most 1, again.
        """
        return cls(
            form="published",
            grid=PolarGrid(sectors=72, max_range=100.0, first_width=0.5),
            process=GaussianProcess(
                length_scale=10.0, signal_deviation=1.0, noise_deviation=math.sqrt(0.3)
            ),
            variance_limit=5.0,
            residual_limit=5.0,
            height_limit=0.3,
            seed_height=15.0,
            seed_range=50.0,
            seed_count=10,
            min_points=6,
        )

    def find(self, cloud: PointCloud) -> Ground:
        """Return the ground of a cloud whose z axis points upwards within `max_tilt`.

        Never raises for want of ground: see `Ground.status` and `Ground.reason`.
        """
        if self.form == "published":
            return self._find_published(cloud)
        points, rotation, prototypes, plane = self._upright(cloud.points)
        if len(prototypes.points) < _LEAST_PROTOTYPES:
            return Ground.none(
                len(cloud),
                f"only {len(prototypes.points)} cells within {self.grid.max_range:g} m of the "
                "origin hold points",
            )
        if plane is None:
            return Ground.none(len(cloud), "no plane fits the lowest points")
        up = rotation.T @ plane.normal
        tilt = math.atan2(math.hypot(up[0], up[1]), up[2])
        if tilt > self.max_tilt:
            return Ground.none(
                len(cloud), f"the lowest points lie in a plane {math.degrees(tilt):.0f} deg off z"
            )
        base = fit_base_surface(points, prototypes, plane, self.grid)
        accepted, modelled = modelled_heights(
            prototypes,
            plane,
            base,
            self.process,
            self.lending,
            seed_height=self.seed_height,
            seed_range=self.seed_range,
            variance_limit=self.variance_limit,
            residual_limit=self.residual_limit,
        )
        height, is_ground, is_below, near, close = split_by_knots(
            read_only(points),
            prototypes.cell_of_point,
            plane.coefficients,
            knots_of_model(prototypes, modelled, base.sharp, self.height_limit),
            self.height_limit,
        )
        count, breadth, sectors = extent(prototypes.points, read_only(accepted), prototypes.starts)
        doubt = self._doubt_about(count, len(accepted), breadth, close, near)
        if doubt:
            return Ground.none(len(cloud), doubt)
        tilted = tilt > self.level_tilt
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.TILTED if tilted else GroundStatus.FOUND,
            reason=f"{count / len(accepted):.0%} of the lowest points of all cells are ground"
            + (f", {math.degrees(tilt):.0f} degrees off the z axis" if tilted else ""),
            plane=np.append(up, plane.offset),
            sensor_height=math.nan if cloud.origin.any() else plane.offset,
            sectors=sectors,
        )

    def _upright(self, points: Points) -> tuple[Points, Matrix, Prototypes, BasePlane | None]:
        """Return the points with their ground level, how they were turned, and what it shows."""
        rotation = np.eye(3)
        prototypes = Prototypes.of(points, self.grid, self.min_points)
        plane = fit_base_plane(prototypes.points, max_tilt=self.max_tilt)
        # The second turn mends what prototypes taken in a tilted frame got wrong.
        for _ in range(2):
            if plane is None or plane.tilt <= self.level_tilt or plane.support < _FIRM_SUPPORT:
                break
            turn = rotation_onto_z(plane.normal)
            points, rotation = turned_points(read_only(points), read_only(turn)), turn @ rotation
            prototypes = Prototypes.of(points, self.grid, self.min_points)
            plane = fit_base_plane(prototypes.points, max_tilt=self.max_tilt)
        return points, rotation, prototypes, plane

    def _doubt_about(
        self, count: int, prototypes: int, breadth: float, close: int, near: int
    ) -> str:
        """Return why `count` ground prototypes are no ground; empty if nothing speaks against it.

        They spread by `breadth` [m] at least. Of `near` points within three limits of the model,
        `close` lie within one.
        """
        if count < max(_LEAST_PROTOTYPES, self.min_support * prototypes):
            return f"only {count} of the {prototypes} lowest points lie on a common surface"
        if breadth < _LEAST_BREADTH:
            return f"the lowest points lie along a line, {breadth:.2f} m wide"
        if close < self.min_sharpness * near:
            return (
                f"only {close / near:.0%} of the points near the modelled ground lie on it; it "
                "is no surface"
            )
        return ""

    def _find_published(self, cloud: PointCloud) -> Ground:
        prototypes = Prototypes.of(cloud.points, self.grid, self.min_points)
        knots, sectors = published_knots(
            prototypes,
            self.process,
            variance_limit=self.variance_limit,
            residual_limit=self.residual_limit,
            seed_height=self.seed_height,
            seed_range=self.seed_range,
            seed_count=self.seed_count,
            height_limit=self.height_limit,
        )
        if sectors == 0:
            return Ground.none(len(cloud), "no sector has two prototypes to start from")
        height, is_ground, is_below, _, _ = split_by_knots(
            cloud.points,
            prototypes.cell_of_point,
            read_only(_UPWARDS),
            knots,
            self.height_limit,
        )
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.FOUND,
            reason=f"{sectors} sectors have prototypes to start from, believed as published",
            plane=np.array([0.0, 0.0, 1.0, math.nan]),
            sensor_height=math.nan,
            sectors=sectors,
        )
