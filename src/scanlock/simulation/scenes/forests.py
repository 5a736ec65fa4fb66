"""Sparse forest with a winding path and a gazebo, for a slow robot."""

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Vector
from scanlock.simulation.drive import ROBOT, Drive
from scanlock.simulation.objects import furniture, plants
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, upright_pose
from scanlock.simulation.scenes.world_builder import WorldBuilder
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.terrain.waves import Waves

_MARGIN = 70.0
"""Extent of the terrain beyond the path [m]."""

_CLEARANCE = 1.3
"""Half width of the path [m]."""

_DETAIL_DISTANCE = 22.0
"""Distance from the path beyond which plants have fewer and larger leaves [m]."""


def forest(rng: np.random.Generator) -> Scene:
    """Generate a sparse forest around a closed path of about 200 m.

    It has leaning, tapering trunks, porous crowns and shrubs, patches of grass, uneven ground and
    one gazebo near the path.

    Parameters
    ----------
    rng : Generator
        Source of all random choices.

    Returns
    -------
    Scene
    """
    path = _path(rng)
    low, high = path.points.min(axis=0) - _MARGIN, path.points.max(axis=0) + _MARGIN
    relief = [
        Waves.drawn(rng, rng.uniform(0.4, 0.8), 30.0, 100.0),
        Waves.drawn(rng, 0.06, 6.0, 15.0),
        Waves.drawn(rng, 0.012, 1.5, 4.0),
    ]
    ground = HeightField.sampled(
        lambda at: sum((wave.at(at) for wave in relief), np.zeros(len(at))),
        low,
        high,
        cell=0.5,
    )
    site = Site(low, high)
    planter = _Planter(rng, ground, site, path)
    site.block(planter.path_distance(site.cells()) < 0.0)
    planter.build_gazebo()
    planter.plant_trees()
    planter.plant_shrubs()
    planter.scatter_logs_and_rocks()
    planter.sow_grass()
    return Scene(name="forest", world=planter.builder.world(ground), track=path, carrier=ROBOT)


def forest_walk(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.08,
    start: float = 0.0,
) -> Drive:
    """Simulate a slow robot on the path.

    Parameters
    ----------
    scene, rng, count, spacing, start
        As for `drive_along`; the default spacing is that of 0.1 s at the speed of the robot.

    Returns
    -------
    Drive
    """
    return scene.drive(rng, count=count, spacing=spacing, start=start)


class _Planter:
    """Generator of the objects of a forest, which do not overlap."""

    def __init__(
        self, rng: np.random.Generator, ground: HeightField, site: Site, path: Track
    ) -> None:
        self.builder = WorldBuilder()
        self._rng = rng
        self._ground = ground
        self._site = site
        self._path = path

    def path_distance(self, positions: Matrix) -> Vector:
        """Return the (n,) distances from the edge of the path, negative on the path [m]."""
        return KDTree(self._path.points).query(positions)[0] - _CLEARANCE

    def build_gazebo(self) -> None:
        """Add a gazebo a few metres beside the path."""
        rng = self._rng
        for _ in range(20):
            aside = float(rng.choice([-1.0, 1.0])) * rng.uniform(6.0, 9.0)
            position = self._path.at(rng.uniform(0.0, self._path.length), aside)[0]
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            if self._add(furniture.gazebo(rng), position, yaw, (7.0, 7.0)):
                return

    def plant_trees(self) -> None:
        """Add trees of two kinds with varying density."""
        rng = self._rng
        density = Waves.drawn(rng, 1.0, 20.0, 80.0)
        for position, distance in self._candidates(2400, 55.0):
            if density.at(position[None])[0] < rng.normal(0.0, 0.8):
                continue
            leaves = 1.0 if distance < _DETAIL_DISTANCE else 0.25
            height = rng.uniform(5.0, 18.0)
            if rng.random() < 0.3:
                tree = plants.conifer(
                    rng,
                    height=0.8 * height,
                    radius=height * rng.uniform(0.12, 0.2),
                    leaves=leaves,
                )
            else:
                tree = plants.tree(
                    rng,
                    height=height,
                    crown_radius=rng.uniform(1.2, 2.2) + 0.1 * height,
                    trunk_radius=rng.uniform(0.06, 0.12) + 0.011 * height,
                    leaves=leaves,
                )
            side = rng.uniform(2.0, 4.5)
            self._add(tree, position, rng.uniform(0.0, 2.0 * np.pi), (side, side))

    def plant_shrubs(self) -> None:
        """Add shrubs between the trees."""
        rng = self._rng
        for position, distance in self._candidates(420, 45.0):
            radius = rng.uniform(0.3, 1.0)
            shrub = plants.shrub(
                rng,
                radius=radius,
                height=radius * rng.uniform(0.9, 2.2),
                leaves=1.0 if distance < _DETAIL_DISTANCE else 0.3,
            )
            self._add(shrub, position, rng.uniform(0.0, 2.0 * np.pi), (radius, radius))

    def scatter_logs_and_rocks(self) -> None:
        """Add fallen trunks and boulders."""
        rng = self._rng
        for position, _ in self._candidates(120, 35.0):
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            if rng.random() < 0.3:
                length = rng.uniform(1.5, 6.0)
                log = plants.log(rng, length=length, radius=rng.uniform(0.1, 0.25))
                self._add(log, position, yaw, (length, 0.4))
            else:
                self._add(furniture.boulder(rng), position, yaw, (0.8, 0.8))

    def sow_grass(self) -> None:
        """Add patches of grass, shorter on the path."""
        rng = self._rng
        patches = Waves.drawn(rng, 1.0, 5.0, 30.0)
        positions = rng.uniform(self._site.low, self._site.high, (150000, 2))
        distances = self.path_distance(positions)
        has_grass = (patches.at(positions) > 0.3) & (distances < 18.0)
        for on_path, height in ((True, 0.07), (False, 0.25)):
            chosen = positions[has_grass & ((distances < 0.0) == on_path)]
            self.builder.add(plants.grass(rng, self._ground.lifted(chosen), height))

    def _candidates(self, count: int, max_distance: float) -> list[tuple[Vector, float]]:
        """Return random positions beside the path, with their distances from it [m]."""
        positions = self._rng.uniform(self._site.low, self._site.high, (count, 2))
        distances = self.path_distance(positions)
        chosen = (distances > 0.3) & (distances < max_distance)
        return list(zip(positions[chosen], distances[chosen].tolist(), strict=True))

    def _add(
        self, surfaces: Surfaces, position: Vector, yaw: float, size: tuple[float, float]
    ) -> bool:
        """Add an object if its footprint is free; return whether it was."""
        if not self._site.claim(position, yaw, *size):
            return False
        self.builder.add(surfaces, upright_pose(self._ground.lifted(position[None])[0], yaw))
        return True


def _path(rng: np.random.Generator) -> Track:
    """Generate a winding closed path."""
    angles = (np.arange(9) + rng.uniform(-0.25, 0.25, 9)) * (2.0 * np.pi / 9.0)
    radii = rng.uniform(20.0, 40.0, 9)
    return Track.round(np.column_stack([radii * np.cos(angles), radii * np.sin(angles)]), bend=3.0)
