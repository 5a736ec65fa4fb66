"""Ground segmentation: chi of Das et al. 2013, section IV.

Polar prototypes, a base plane through them, one Gaussian process per sector about that plane
grown by incremental sample consensus (INSAC), and a decision for every point.
"""

import enum
import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from scanlock.arrays import Mask, Points, Vector, frozen, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput, require_count, require_fraction, require_positive
from scanlock.geometry.rotations import rotation_onto_z
from scanlock.kernels.ground import split_by_height, turned_points
from scanlock.models.gaussian_process import GaussianProcess, Lending
from scanlock.models.ground_base import fit_base_surface
from scanlock.models.ground_model import BLUNT_LIMIT, heights_above_model, modelled_heights
from scanlock.models.ground_plane import fit_base_plane
from scanlock.models.ground_prototypes import Prototypes
from scanlock.models.ground_published import published_heights

_LEAST_PROTOTYPES = 10
"""Fewer low points on the base plane are no evidence of a ground (ours)."""

_LEAST_BREADTH = 0.5
"""Standard deviation [m] that the ground must spread along both its axes (ours): the foot of a
wall is a line, a step of a stair a narrow strip."""

_FIRM_SUPPORT = 0.2
"""Share of the lowest points on the base plane from which its tilt is believed (ours)."""

_NO_PLANE = np.array([0.0, 0.0, 1.0, math.nan])


class GroundStatus(enum.Enum):
    """Whether there is a ground to speak of."""

    FOUND = "found"
    """A ground, and the z axis of the cloud is its upward normal to a few degrees."""

    TILTED = "tilted"
    """A ground just as trusted, found after turning the cloud upright: z is not up."""

    NONE = "none"
    """No believable ground; no point is called ground."""


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """What is ground in a cloud, and where the ground lies.

    Attributes
    ----------
    is_ground : (n,)
        One answer for each row of ``cloud.points``.
    is_below : (n,)
        Points clearly beneath the modelled ground: reflections, or a lower level. Never ground.
    height : (n,) [m]
        Height above the modelled ground; NaN where nothing is modelled.
    status : GroundStatus
        Whether a ground was found.
    reason : str
        One sentence that says why.
    plane : (4,)
        The base plane: ``plane[:3] @ p + plane[3]`` is the height of p above it [m].
        ``plane[3]`` is NaN without ground.
    sensor_height : float [m]
        Height of the origin of the cloud's frame above the base plane; NaN without ground, and
        where the cloud was recentred, so that its origin is no sensor.
    sectors : int
        Sectors with ground of their own, not lent by neighbours.
    """

    is_ground: Mask
    is_below: Mask
    height: Vector
    status: GroundStatus
    reason: str
    plane: Vector
    sensor_height: float
    sectors: int

    def __post_init__(self) -> None:
        for array in (self.is_ground, self.is_below, self.height, self.plane):
            frozen(array)

    @property
    def up(self) -> Vector:
        """(3,) unit normal of the base plane in the frame of the cloud; z without ground."""
        return self.plane[:3]

    @property
    def tilt(self) -> float:
        """Angle between `up` and the z axis [rad]."""
        x, y, z = self.up
        return math.atan2(math.hypot(x, y), z)


@dataclass(frozen=True, kw_only=True, slots=True)
class GroundFinder:
    """Finds the ground of one scan.

    ``GroundFinder()`` is the corrected method, which needs no sensor height;
    ``GroundFinder.das2013()`` the method with its published constants and defects.
    """

    form: Literal["corrected", "published"] = "corrected"
    """Corrected: heights about a base plane, decided against the model, uncertain sectors
    helped by their neighbours. Published: heights about the sensor's own, decided against the
    lowest point of each cell."""

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

    min_sharpness: float = 0.55
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
        the public code it answers for every point: what that code leaves out is not ground.
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
        points, rotation = cloud.points, np.eye(3)
        prototypes = Prototypes.of(points, self.grid, self.min_points)
        plane = fit_base_plane(prototypes.points, max_tilt=self.max_tilt)
        # The second turn mends what prototypes taken in a tilted frame got wrong.
        for _ in range(2):
            if plane is None or plane.tilt <= self.level_tilt or plane.support < _FIRM_SUPPORT:
                break
            upright = rotation_onto_z(plane.normal)
            points = turned_points(read_only(points), read_only(upright))
            rotation = upright @ rotation
            prototypes = Prototypes.of(points, self.grid, self.min_points)
            plane = fit_base_plane(prototypes.points, max_tilt=self.max_tilt)
        if plane is None:
            return _no_ground(cloud, "no plane fits the lowest points")
        up = rotation.T @ plane.normal
        if _tilt(up) > self.max_tilt:
            return _no_ground(
                cloud, f"the lowest points lie in a plane {math.degrees(_tilt(up)):.0f} deg off z"
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
        height = heights_above_model(points, prototypes, plane, modelled)
        limits = np.full(len(prototypes.lowest), self.height_limit)
        limits[prototypes.cells[~base.sharp]] = min(self.height_limit, BLUNT_LIMIT)
        is_ground, is_below, near, close = split_by_height(
            read_only(height), prototypes.cell_of_point, read_only(limits), self.height_limit
        )
        doubt = self._doubt_about(prototypes.points[accepted], len(accepted)) or self._blur(
            close, near
        )
        if doubt:
            return _no_ground(cloud, doubt)
        tilted = _tilt(up) > self.level_tilt
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.TILTED if tilted else GroundStatus.FOUND,
            reason=f"{accepted.mean():.0%} of the lowest points of all cells are ground"
            + (f", {math.degrees(_tilt(up)):.0f} degrees off the z axis" if tilted else ""),
            plane=np.append(up, plane.offset),
            sensor_height=math.nan if cloud.origin.any() else plane.offset,
            sectors=prototypes.sectors_of(accepted),
        )

    def _doubt_about(self, ground: Points, prototypes: int) -> str:
        """Return why so many ground prototypes are no ground; empty if they may be one."""
        share = len(ground) / max(prototypes, 1)
        if len(ground) < _LEAST_PROTOTYPES or share < self.min_support:
            return f"only {len(ground)} of the {prototypes} lowest points lie on a common surface"
        breadth = math.sqrt(max(np.linalg.eigvalsh(np.cov(ground[:, :2].T))[0], 0.0))
        if breadth < _LEAST_BREADTH:
            return f"the lowest points lie along a line, {breadth:.2f} m wide"
        return ""

    def _blur(self, on_ground: int, near: int) -> str:
        """Return why the points near the ground are no surface; empty if they are one."""
        sharpness = on_ground / max(near, 1)
        if sharpness >= self.min_sharpness:
            return ""
        return (
            f"only {sharpness:.0%} of the points near the modelled ground lie on it; "
            "it is no surface"
        )

    def _find_published(self, cloud: PointCloud) -> Ground:
        prototypes = Prototypes.of(cloud.points, self.grid, self.min_points)
        height, sectors = published_heights(
            cloud.points,
            prototypes,
            self.process,
            variance_limit=self.variance_limit,
            residual_limit=self.residual_limit,
            seed_height=self.seed_height,
            seed_range=self.seed_range,
            seed_count=self.seed_count,
        )
        if sectors == 0:
            return _no_ground(cloud, "no sector has two prototypes to start from")
        limits = read_only(np.full(len(prototypes.lowest), self.height_limit))
        is_ground, is_below, _, _ = split_by_height(
            read_only(height), prototypes.cell_of_point, limits, self.height_limit
        )
        return Ground(
            is_ground=is_ground,
            is_below=is_below,
            height=height,
            status=GroundStatus.FOUND,
            reason=f"{sectors} sectors have prototypes to start from, believed as published",
            plane=_NO_PLANE,
            sensor_height=math.nan,
            sectors=sectors,
        )


def _tilt(normal: Vector) -> float:
    return math.atan2(math.hypot(normal[0], normal[1]), normal[2])


def _no_ground(cloud: PointCloud, reason: str) -> Ground:
    n = len(cloud)
    return Ground(
        is_ground=np.zeros(n, dtype=np.bool_),
        is_below=np.zeros(n, dtype=np.bool_),
        height=np.full(n, np.nan),
        status=GroundStatus.NONE,
        reason=reason,
        plane=_NO_PLANE.copy(),
        sensor_height=math.nan,
        sectors=0,
    )
