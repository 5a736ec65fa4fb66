"""A sparse, park-like forest with a winding path and a gazebo, as a robot drives through it."""

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Vector
from scanlock.simulation.drive import ROBOT, Drive
from scanlock.simulation.objects import furniture, plants
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, standing
from scanlock.simulation.scenes.stage import Stage
from scanlock.simulation.scenes.terrain import Waves
from scanlock.simulation.scenes.track import Track

_MARGIN = 70.0
"""How far the ground goes on beyond the path [m]."""

_CLEARANCE = 1.3
"""Half the width of the path [m]."""

_CLOSE = 22.0
"""Plants farther from the path than this [m] have fewer and larger leaves."""


def forest(rng: np.random.Generator) -> Scene:
    """Return a sparse forest around a closed path, about 200 m long.

    Trunks lean and taper, crowns and shrubs have gaps, grass grows in patches, the ground rolls,
    and one gazebo stands near the path.
    """
    path = _path(rng)
    low, high = path.points.min(axis=0) - _MARGIN, path.points.max(axis=0) + _MARGIN
    relief = [
        Waves.drawn(rng, rng.uniform(0.4, 0.8), 30.0, 100.0),
        Waves.drawn(rng, 0.06, 6.0, 15.0),
        Waves.drawn(rng, 0.012, 1.5, 4.0),
    ]
    ground = HeightField.sampled(
        lambda places: sum((wave.at(places) for wave in relief), np.zeros(len(places))),
        low,
        high,
        cell=0.5,
    )
    site = Site(low, high)
    planter = _Planter(rng, ground, site, path)
    site.block(planter.gap(site.cells()) < 0.0)
    planter.build_gazebo()
    planter.plant_trees()
    planter.plant_shrubs()
    planter.scatter_logs_and_rocks()
    planter.sow_grass()
    return Scene("forest", planter.stage.world(ground), path, ROBOT)


def forest_walk(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.08,
    start: float = 0.0,
) -> Drive:
    """Return the poses of a slow robot along the path, one a tenth of a second as it drives."""
    return scene.drive(rng, count=count, spacing=spacing, start=start)


class _Planter:
    """Plants a forest around a path, everything on free ground."""

    def __init__(
        self, rng: np.random.Generator, ground: HeightField, site: Site, path: Track
    ) -> None:
        self.stage = Stage()
        self._rng = rng
        self._ground = ground
        self._site = site
        self._path = path

    def gap(self, places: Matrix) -> Vector:
        """Return how far (n, 2) places are from the edge of the path, negative on it [m]."""
        return KDTree(self._path.points).query(places)[0] - _CLEARANCE

    def build_gazebo(self) -> None:
        """Build a gazebo a few metres beside the path."""
        rng = self._rng
        for _ in range(20):
            aside = float(rng.choice([-1.0, 1.0])) * rng.uniform(6.0, 9.0)
            place = self._path.at(rng.uniform(0.0, self._path.length), aside)[0]
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            if self._put(furniture.gazebo(rng), place, yaw, (7.0, 7.0)):
                return

    def plant_trees(self) -> None:
        """Plant trees of two kinds, denser here and sparser there."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 20.0, 80.0)
        for place, gap in self._candidates(2400, 55.0):
            if density.at(place[None])[0] < rng.normal(0.0, 0.8):
                continue
            leaves = 1.0 if gap < _CLOSE else 0.25
            height = rng.uniform(5.0, 18.0)
            if rng.random() < 0.3:
                thing = plants.conifer(
                    rng,
                    height=0.8 * height,
                    radius=height * rng.uniform(0.12, 0.2),
                    leaves=leaves,
                )
            else:
                thing = plants.tree(
                    rng,
                    height=height,
                    crown_radius=rng.uniform(1.2, 2.2) + 0.1 * height,
                    trunk_radius=rng.uniform(0.06, 0.12) + 0.011 * height,
                    leaves=leaves,
                )
            room = rng.uniform(2.0, 4.5)
            self._put(thing, place, rng.uniform(0.0, 2.0 * np.pi), (room, room))

    def plant_shrubs(self) -> None:
        """Plant bushes between the trees."""
        rng = self._rng
        for place, gap in self._candidates(420, 45.0):
            radius = rng.uniform(0.3, 1.0)
            thing = plants.shrub(
                rng,
                radius=radius,
                height=radius * rng.uniform(0.9, 2.2),
                leaves=1.0 if gap < _CLOSE else 0.3,
            )
            self._put(thing, place, rng.uniform(0.0, 2.0 * np.pi), (radius, radius))

    def scatter_logs_and_rocks(self) -> None:
        """Leave fallen trunks and boulders lying about."""
        rng = self._rng
        for place, _ in self._candidates(120, 35.0):
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            if rng.random() < 0.3:
                length = rng.uniform(1.5, 6.0)
                thing = plants.log(rng, length=length, radius=rng.uniform(0.1, 0.25))
                self._put(thing, place, yaw, (length, 0.4))
            else:
                self._put(furniture.boulder(rng), place, yaw, (0.8, 0.8))

    def sow_grass(self) -> None:
        """Let grass grow in patches, shorter on the path."""
        rng = self._rng
        patches = Waves.drawn(rng, 1.0, 5.0, 30.0)
        places = rng.uniform(self._site.low, self._site.high, (150000, 2))
        gaps = self.gap(places)
        growing = (patches.at(places) > 0.3) & (gaps < 18.0)
        for on_path, height in ((True, 0.07), (False, 0.25)):
            chosen = places[growing & ((gaps < 0.0) == on_path)]
            self.stage.put(plants.grass(rng, self._ground.lifted(chosen), height))

    def _candidates(self, count: int, reach: float) -> list[tuple[Vector, float]]:
        """Return random places off the path within reach of it, each with its gap [m]."""
        places = self._rng.uniform(self._site.low, self._site.high, (count, 2))
        gaps = self.gap(places)
        chosen = (gaps > 0.3) & (gaps < reach)
        return list(zip(places[chosen], gaps[chosen].tolist(), strict=True))

    def _put(self, thing: Surfaces, place: Vector, yaw: float, size: tuple[float, float]) -> bool:
        if not self._site.claim(place, yaw, *size):
            return False
        self.stage.put(thing, standing(self._ground.lifted(place[None])[0], yaw))
        return True


def _path(rng: np.random.Generator) -> Track:
    """Return a winding closed path."""
    angles = (np.arange(9) + rng.uniform(-0.25, 0.25, 9)) * (2.0 * np.pi / 9.0)
    radii = rng.uniform(20.0, 40.0, 9)
    return Track.round(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), bend=3.0)
