"""Rugged, vegetated terrain without a road, as an off-road vehicle drives over it."""

from dataclasses import replace

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Vector
from scanlock.simulation.drive import Carrier, Drive
from scanlock.simulation.objects import furniture, plants
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, standing
from scanlock.simulation.scenes.stage import Stage
from scanlock.simulation.scenes.terrain import Waves
from scanlock.simulation.scenes.track import Track

XUV = Carrier(sensor_height=1.5, wheelbase=2.0, gauge=1.4, speed=5.6, sway=0.02, wander=0.3)
"""A four-wheeled off-road vehicle of 3 m by 1.7 m at 20 km/h, its frame 1.5 m above the ground."""

_MARGIN = 75.0
"""How far the ground goes on beyond the way [m]."""

_CELL = 0.25
"""Distance between neighbouring heights [m]; a rut is a little wider."""

_CLEARANCE = 1.6
"""How far trees, bushes and rocks keep from the middle of the way [m]."""

_CLOSE = 25.0
"""Plants farther from the way than this [m] have fewer and larger leaves."""

_RUT_WIDTH = 0.22
"""Standard deviation of a rut across [m]; as wide as a tyre where it is deep."""

_GRASS_REACH = 13.0
"""Grass and herbs grow up to this far from the way [m]; farther off no beam can tell."""


def rugged(rng: np.random.Generator) -> Scene:
    """Return rolling, bumpy and rutted ground with grass, bushes, trees and a few rocks.

    No road leads through it: the way, closed and about 300 m long, is where nothing stands that
    a vehicle could not drive over: grass and herbs grow on it, and the ruts of others cross it.
    """
    way = _way(rng)
    low, high = way.points.min(axis=0) - _MARGIN, way.points.max(axis=0) + _MARGIN
    ground = _ground(rng, low, high)
    planter = _Planter(rng, ground, Site(low, high), way)
    planter.plant_trees()
    planter.plant_bushes()
    planter.scatter_rocks_and_logs()
    planter.sow_grass()
    planter.sow_herbs()
    return Scene("rugged", planter.stage.world(ground), way, XUV)


def rugged_drive(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.56,
    start: float = 0.0,
    speed: float = XUV.speed,
) -> Drive:
    """Return the poses of an off-road vehicle, one a tenth of a second at 20 km/h as it drives.

    It pitches and rolls as its four wheels follow the ground. At another `speed` [m/s] the
    poses are those of the same places, at other times and with other twists.
    """
    at_speed = replace(scene, carrier=replace(scene.carrier, speed=speed))
    return at_speed.drive(rng, count=count, spacing=spacing, start=start)


def _ground(rng: np.random.Generator, low: Vector, high: Vector) -> HeightField:
    """Return hills with bumps on them, rough here and smoother there, and ruts."""
    hills = Waves.drawn(rng, rng.uniform(0.9, 1.5), 30.0, 90.0)
    roughness = Waves.drawn(rng, 0.5, 15.0, 60.0)
    bumps = [
        Waves.drawn(rng, deviation, shortest, longest)
        for deviation, shortest, longest in (
            (0.09, 5.0, 14.0), (0.04, 2.0, 5.0), (0.025, 2.0, 5.0), (0.01, 0.8, 2.0),
        )
    ]  # fmt: skip
    ruts = [_Ruts(rng, low, high) for _ in range(6)]

    def height(places: Matrix) -> Vector:
        rough = np.clip(1.0 + roughness.at(places), 0.2, 2.0)
        bumpy = sum((wave.at(places) for wave in bumps), np.zeros(len(places)))
        worn = np.max([rut.depth_at(places) for rut in ruts], axis=0)
        return hills.at(places) + rough * bumpy - worn

    return HeightField.sampled(height, low, high, _CELL)


class _Ruts:
    """Two grooves that a vehicle has left on its way across the site, here deeper, there none."""

    def __init__(self, rng: np.random.Generator, low: Vector, high: Vector) -> None:
        middle, reach = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
        ahead = rng.uniform(0.0, 2.0 * np.pi)
        axis = np.array([np.cos(ahead), np.sin(ahead)])
        across = np.array([-axis[1], axis[0]])
        along = np.arange(-reach, reach, 0.25)
        bend = Waves.drawn(rng, 6.0, 60.0, 200.0).at(np.column_stack([along, 0.0 * along]))
        aside = rng.uniform(-0.5, 0.5) * reach + bend
        self._line = KDTree(middle + along[:, None] * axis + aside[:, None] * across)
        self._half_gauge = 0.5 * XUV.gauge * rng.uniform(0.9, 1.3)
        self._depth = rng.uniform(0.1, 0.22)
        self._worn = Waves.drawn(rng, 1.0, 8.0, 40.0)

    def depth_at(self, places: Matrix) -> Vector:
        """Return how deep (n,) the grooves are at (n, 2) places [m]."""
        limit = self._half_gauge + 4.0 * _RUT_WIDTH
        aside = self._line.query(places, distance_upper_bound=limit)[0]
        near = np.flatnonzero(np.isfinite(aside))
        depth = np.zeros(len(places))
        profile = np.exp(-0.5 * ((aside[near] - self._half_gauge) / _RUT_WIDTH) ** 2)
        worn = np.clip(0.5 + self._worn.at(places[near]), 0.0, 1.0)
        depth[near] = self._depth * worn * profile
        return depth


class _Planter:
    """Plants the terrain around a way, everything that stops a vehicle on free ground."""

    def __init__(
        self, rng: np.random.Generator, ground: HeightField, site: Site, way: Track
    ) -> None:
        self.stage = Stage()
        self._rng = rng
        self._ground = ground
        self._site = site
        self._way = way
        self._line = KDTree(way.points)
        site.block(self.gap(site.cells()) < 0.0)

    def gap(self, places: Matrix) -> Vector:
        """Return how far (n, 2) places are from the strip that is kept clear, negative in it."""
        return self._line.query(places)[0] - _CLEARANCE

    def plant_trees(self) -> None:
        """Plant trees in loose groups, some of them conifers."""
        rng = self._rng
        wooded = Waves.drawn(rng, 1.0, 25.0, 90.0)
        for place, gap in self._candidates(2200, 1.5, 60.0):
            if wooded.at(place[None])[0] < rng.normal(0.5, 0.6):
                continue
            leaves = 1.0 if gap < _CLOSE else 0.25
            height = rng.uniform(4.0, 14.0)
            if rng.random() < 0.35:
                radius = height * rng.uniform(0.13, 0.22)
                thing = plants.conifer(rng, height=0.8 * height, radius=radius, leaves=leaves)
            else:
                thing = plants.tree(
                    rng,
                    height=height,
                    crown_radius=rng.uniform(1.0, 1.8) + 0.11 * height,
                    trunk_radius=rng.uniform(0.05, 0.1) + 0.011 * height,
                    leaves=leaves,
                )
            room = rng.uniform(1.5, 3.5)
            self._put(thing, place, (room, room))

    def plant_bushes(self) -> None:
        """Plant bushes of all sizes in thickets."""
        rng = self._rng
        thick = Waves.drawn(rng, 1.0, 8.0, 40.0)
        for place, gap in self._candidates(11000, 0.3, 40.0):
            if thick.at(place[None])[0] < rng.normal(0.2, 0.5):
                continue
            # Small bushes grow nearer to the way than large ones, whose twigs reach out.
            radius = rng.uniform(0.25, 1.1)
            if gap < radius:
                continue
            thing = plants.shrub(
                rng,
                radius=radius,
                height=radius * rng.uniform(1.0, 2.2),
                leaves=1.0 if gap < _CLOSE else 0.3,
            )
            self._put(thing, place, (radius, radius))

    def scatter_rocks_and_logs(self) -> None:
        """Leave a few boulders and fallen trunks lying about."""
        rng = self._rng
        for place, _ in self._candidates(160, 0.3, 35.0):
            if rng.random() < 0.25:
                length = rng.uniform(1.5, 5.0)
                log = plants.log(rng, length=length, radius=rng.uniform(0.1, 0.2))
                self._put(log, place, (length, 0.4))
            else:
                self._put(furniture.boulder(rng), place, (0.8, 0.8))

    def sow_grass(self) -> None:
        """Let grass grow everywhere, in patches low and thin or tall and dense."""
        rng = self._rng
        lush = Waves.drawn(rng, 1.0, 4.0, 25.0)
        places = self._strip(120000)
        growth = lush.at(places) + rng.normal(0.0, 0.4, len(places))
        for least, most, height in ((-1.0, 0.4, 0.12), (0.4, 1.3, 0.3), (1.3, np.inf, 0.55)):
            chosen = places[(growth > least) & (growth <= most)]
            self.stage.put(plants.grass(rng, self._ground.lifted(chosen), height))

    def sow_herbs(self) -> None:
        """Let herbs and saplings up to the knee grow in patches, on the way as well."""
        rng = self._rng
        weedy = Waves.drawn(rng, 1.0, 4.0, 25.0)
        places = self._strip(6000)
        places = places[weedy.at(places) > rng.normal(0.3, 0.5, len(places))]
        for foot in self._ground.lifted(places):
            radius = rng.uniform(0.1, 0.28)
            herb = plants.shrub(
                rng, radius=radius, height=radius * rng.uniform(1.0, 2.0), leaves=0.2
            )
            self.stage.put(herb, standing(foot, rng.uniform(0.0, 2.0 * np.pi)))

    def _strip(self, count: int) -> Matrix:
        """Return random places (n, 2) [m] on the way and beside it."""
        along = self._rng.uniform(0.0, self._way.length, count)
        return self._way.at(along, self._rng.uniform(-_GRASS_REACH, _GRASS_REACH, count))

    def _candidates(self, count: int, least: float, reach: float) -> list[tuple[Vector, float]]:
        """Return random places with a gap to the way from least to reach, each with its own [m]."""
        places = self._rng.uniform(self._site.low, self._site.high, (count, 2))
        gaps = self.gap(places)
        chosen = (gaps > least) & (gaps < reach)
        return list(zip(places[chosen], gaps[chosen].tolist(), strict=True))

    def _put(self, thing: Surfaces, place: Vector, size: tuple[float, float]) -> None:
        yaw = self._rng.uniform(0.0, 2.0 * np.pi)
        if self._site.claim(place, yaw, *size):
            self.stage.put(thing, standing(self._ground.lifted(place[None])[0], yaw))


def _way(rng: np.random.Generator) -> Track:
    """Return a winding closed way."""
    angles = (np.arange(10) + rng.uniform(-0.25, 0.25, 10)) * (2.0 * np.pi / 10.0)
    radii = rng.uniform(30.0, 62.0, 10)
    return Track.round(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), bend=4.0)
