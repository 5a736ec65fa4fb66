"""Rugged, vegetated terrain without roads, for an off-road vehicle."""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Vector
from scanlock.simulation.drive import Carrier, Drive
from scanlock.simulation.objects import furniture, plants
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, upright_pose
from scanlock.simulation.scenes.world_builder import WorldBuilder
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.terrain.waves import Waves

XUV = Carrier(sensor_height=1.5, wheelbase=2.0, gauge=1.4, speed=5.6, sway=0.02, wander=0.3)
"""An off-road vehicle of 3 m by 1.7 m at 20 km/h, with its frame 1.5 m above the ground."""

_MARGIN = 75.0
"""Extent of the terrain beyond the track [m]."""

_CELL = 0.25
"""Distance between neighbouring heights [m], slightly less than the width of a rut."""

_CLEARANCE = 1.6
"""Minimum distance of trees, shrubs and rocks from the track [m]."""

_DETAIL_DISTANCE = 25.0
"""Distance from the track beyond which plants have fewer and larger leaves [m]."""

_RUT_WIDTH = 0.22
"""Standard deviation of the cross section of a rut [m], about the width of a tyre."""

_MAX_GRASS_DISTANCE = 13.0
"""Maximum distance of grass and herbs from the track [m]; farther away no beam resolves them."""


def rugged(rng: np.random.Generator) -> Scene:
    """Generate hilly, bumpy and rutted terrain with grass, shrubs, trees and a few rocks.

    There is no road. The closed track of about 300 m is free of obstacles, but has grass and herbs
    on it, and ruts across it.

    Parameters
    ----------
    rng : Generator
        Source of all random choices.

    Returns
    -------
    Scene
    """
    track = _track(rng)
    low, high = track.points.min(axis=0) - _MARGIN, track.points.max(axis=0) + _MARGIN
    ground = _ground(rng, low, high)
    planter = _Planter(rng, ground, Site(low, high), track)
    planter.plant_trees()
    planter.plant_shrubs()
    planter.scatter_rocks_and_logs()
    planter.sow_grass()
    planter.sow_herbs()
    return Scene(name="rugged", world=planter.builder.world(ground), track=track, carrier=XUV)


def rugged_drive(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.56,
    start: float = 0.0,
    speed: float = XUV.speed,
) -> Drive:
    """Simulate an off-road vehicle, with pitch and roll from the contact of its four wheels.

    Parameters
    ----------
    scene, rng, count, spacing, start
        As for `drive_along`; the default spacing is that of 0.1 s at 20 km/h.
    speed : float [m/s]
        Speed of the vehicle, which changes times and twists, but not the poses.

    Returns
    -------
    Drive
    """
    at_speed = replace(scene, carrier=replace(scene.carrier, speed=speed))
    return at_speed.drive(rng, count=count, spacing=spacing, start=start)


def _ground(rng: np.random.Generator, low: Vector, high: Vector) -> HeightField:
    """Generate hills with bumps of varying roughness and ruts."""
    hills = Waves.drawn(rng, rng.uniform(0.9, 1.5), 30.0, 90.0)
    roughness = Waves.drawn(rng, 0.5, 15.0, 60.0)
    bumps = [
        Waves.drawn(rng, deviation, min_length, max_length)
        for deviation, min_length, max_length in (
            (0.09, 5.0, 14.0), (0.04, 2.0, 5.0), (0.025, 2.0, 5.0), (0.01, 0.8, 2.0),
        )
    ]  # fmt: skip
    ruts = [_Ruts(rng, low, high) for _ in range(6)]

    def height(positions: Matrix) -> Vector:
        factor = np.clip(1.0 + roughness.at(positions), 0.2, 2.0)
        bump = sum((wave.at(positions) for wave in bumps), np.zeros(len(positions)))
        depth = np.max([rut.depth_at(positions) for rut in ruts], axis=0)
        return hills.at(positions) + factor * bump - depth

    return HeightField.sampled(height, low, high, _CELL)


class _Ruts:
    """Two parallel grooves across the site, of varying depth."""

    def __init__(self, rng: np.random.Generator, low: Vector, high: Vector) -> None:
        middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        heading = rng.uniform(0.0, 2.0 * np.pi)
        axis = np.array([np.cos(heading), np.sin(heading)])
        across = np.array([-axis[1], axis[0]])
        along = np.arange(-radius, radius, 0.25)
        bend = Waves.drawn(rng, 6.0, 60.0, 200.0).at(np.column_stack([along, 0.0 * along]))
        aside = rng.uniform(-0.5, 0.5) * radius + bend
        self._line = KDTree(middle + along[:, None] * axis + aside[:, None] * across)
        self._half_gauge = 0.5 * XUV.gauge * rng.uniform(0.9, 1.3)
        self._depth = rng.uniform(0.1, 0.22)
        self._wear = Waves.drawn(rng, 1.0, 8.0, 40.0)

    def depth_at(self, positions: Matrix) -> Vector:
        """Return the (n,) depths of the grooves at (n, 2) positions [m]."""
        max_distance = self._half_gauge + 4.0 * _RUT_WIDTH
        aside = self._line.query(positions, distance_upper_bound=max_distance)[0]
        near = np.flatnonzero(np.isfinite(aside))
        depth = np.zeros(len(positions))
        profile = np.exp(-0.5 * ((aside[near] - self._half_gauge) / _RUT_WIDTH) ** 2)
        wear = np.clip(0.5 + self._wear.at(positions[near]), 0.0, 1.0)
        depth[near] = self._depth * wear * profile
        return depth


class _Planter:
    """Generator of the objects of the terrain; obstacles do not overlap and avoid the track."""

    def __init__(
        self, rng: np.random.Generator, ground: HeightField, site: Site, track: Track
    ) -> None:
        self.builder = WorldBuilder()
        self._rng = rng
        self._ground = ground
        self._site = site
        self._track = track
        self._line = KDTree(track.points)
        site.block(self.track_distance(site.cells()) < 0.0)

    def track_distance(self, positions: Matrix) -> Vector:
        """Return the (n,) distances from the cleared strip along the track, negative in it [m]."""
        return self._line.query(positions)[0] - _CLEARANCE

    def plant_trees(self) -> None:
        """Add loose groups of trees, some of them conifers."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 25.0, 90.0)
        for position, distance in self._candidates(2200, 1.5, 60.0):
            if density.at(position[None])[0] < rng.normal(0.5, 0.6):
                continue
            leaves = 1.0 if distance < _DETAIL_DISTANCE else 0.25
            height = rng.uniform(4.0, 14.0)
            if rng.random() < 0.35:
                radius = height * rng.uniform(0.13, 0.22)
                tree = plants.conifer(rng, height=0.8 * height, radius=radius, leaves=leaves)
            else:
                tree = plants.tree(
                    rng,
                    height=height,
                    crown_radius=rng.uniform(1.0, 1.8) + 0.11 * height,
                    trunk_radius=rng.uniform(0.05, 0.1) + 0.011 * height,
                    leaves=leaves,
                )
            side = rng.uniform(1.5, 3.5)
            self._add(tree, position, (side, side))

    def plant_shrubs(self) -> None:
        """Add thickets of shrubs of all sizes."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 8.0, 40.0)
        for position, distance in self._candidates(11000, 0.3, 40.0):
            if density.at(position[None])[0] < rng.normal(0.2, 0.5):
                continue
            # No shrub extends into the cleared strip.
            radius = rng.uniform(0.25, 1.1)
            if distance < radius:
                continue
            shrub = plants.shrub(
                rng,
                radius=radius,
                height=radius * rng.uniform(1.0, 2.2),
                leaves=1.0 if distance < _DETAIL_DISTANCE else 0.3,
            )
            self._add(shrub, position, (radius, radius))

    def scatter_rocks_and_logs(self) -> None:
        """Add a few boulders and fallen trunks."""
        rng = self._rng
        for position, _ in self._candidates(160, 0.3, 35.0):
            if rng.random() < 0.25:
                length = rng.uniform(1.5, 5.0)
                log = plants.log(rng, length=length, radius=rng.uniform(0.1, 0.2))
                self._add(log, position, (length, 0.4))
            else:
                self._add(furniture.boulder(rng), position, (0.8, 0.8))

    def sow_grass(self) -> None:
        """Add grass everywhere, in patches of varying height and density."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 4.0, 25.0)
        positions = self._strip(120000)
        growth = density.at(positions) + rng.normal(0.0, 0.4, len(positions))
        for low, high, height in ((-1.0, 0.4, 0.12), (0.4, 1.3, 0.3), (1.3, np.inf, 0.55)):
            chosen = positions[(growth > low) & (growth <= high)]
            self.builder.add(plants.grass(rng, self._ground.lifted(chosen), height))

    def sow_herbs(self) -> None:
        """Add patches of knee-high herbs and saplings, also on the track."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 4.0, 25.0)
        positions = self._strip(6000)
        positions = positions[density.at(positions) > rng.normal(0.3, 0.5, len(positions))]
        for foot in self._ground.lifted(positions):
            radius = rng.uniform(0.1, 0.28)
            herb = plants.shrub(
                rng, radius=radius, height=radius * rng.uniform(1.0, 2.0), leaves=0.2
            )
            self.builder.add(herb, upright_pose(foot, rng.uniform(0.0, 2.0 * np.pi)))

    def _strip(self, count: int) -> Matrix:
        """Return random (n, 2) positions on and beside the track [m]."""
        along = self._rng.uniform(0.0, self._track.length, count)
        aside = self._rng.uniform(-_MAX_GRASS_DISTANCE, _MAX_GRASS_DISTANCE, count)
        return self._track.at(along, aside)

    def _candidates(
        self, count: int, min_distance: float, max_distance: float
    ) -> list[tuple[Vector, float]]:
        """Return random positions beside the track, with their distances from it [m]."""
        positions = self._rng.uniform(self._site.low, self._site.high, (count, 2))
        distances = self.track_distance(positions)
        chosen = (distances > min_distance) & (distances < max_distance)
        return list(zip(positions[chosen], distances[chosen].tolist(), strict=True))

    def _add(self, surfaces: Surfaces, position: Vector, size: tuple[float, float]) -> None:
        """Add an object with a random yaw if its footprint is free."""
        yaw = self._rng.uniform(0.0, 2.0 * np.pi)
        if self._site.claim(position, yaw, *size):
            self.builder.add(surfaces, upright_pose(self._ground.lifted(position[None])[0], yaw))


def _track(rng: np.random.Generator) -> Track:
    """Generate a winding closed track."""
    angles = (np.arange(10) + rng.uniform(-0.25, 0.25, 10)) * (2.0 * np.pi / 10.0)
    radii = rng.uniform(30.0, 62.0, 10)
    return Track.round(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), bend=4.0)
