"""Plots along the streets of a block: houses, gardens and yards, and the land behind them."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.simulation.objects import buildings, furniture, plants, traffic
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.roads import PAVEMENT, Road, RoadNetwork
from scanlock.simulation.scenes.site import Site, car_pose, upright_pose
from scanlock.simulation.scenes.world_builder import WorldBuilder

_DETAIL_DISTANCE = 25.0
"""Distance from a street beyond which plants have fewer and larger leaves [m]."""

_MAX_DISTANCE = 80.0
"""Maximum distance of objects from a street [m]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class _Plot:
    """A section of one side of a road, with x along and y away from it."""

    road: Road
    side: float
    along: float
    width: float

    @property
    def yaw(self) -> float:
        heading = float(self.road.track.heading(self.along)[0])
        return heading if self.side > 0 else heading + np.pi

    def position(self, x: float, y: float) -> Vector:
        """Return the (2,) position at x [m] from the middle and y [m] behind the kerb."""
        along = self.along + self.side * x
        return self.road.track.at(along, self.side * (self.road.half_width + y))[0]


class _PlotBuilder:
    """Generator of the objects on plots, which stand on the ground and do not overlap."""

    def __init__(
        self, rng: np.random.Generator, builder: WorldBuilder, site: Site, roads: RoadNetwork
    ) -> None:
        self.rng = rng
        self._builder = builder
        self._site = site
        self._roads = roads

    def add(
        self,
        surfaces: Surfaces,
        position: Vector,
        yaw: float,
        size: tuple[float, float],
        origin: float = 0.0,
        margin: float = 0.0,
    ) -> bool:
        """Add an object if its footprint, centred `origin` [m] behind it, is free."""
        middle = position + origin * np.array([-np.sin(yaw), np.cos(yaw)])
        if not self._site.claim(middle, yaw, *size, margin=margin):
            return False
        height = self._roads.surface_height(np.atleast_2d(position))[0]
        self._builder.add(surfaces, upright_pose(np.array([*position, height]), yaw))
        return True

    def park(self, position: Vector, yaw: float) -> bool:
        """Add a parked car if its footprint is free."""
        if not self._site.claim(position, yaw, 4.6, 1.8):
            return False
        pose = car_pose(self._roads.surface_height, position, yaw)
        self._builder.add(traffic.car(self.rng), pose)
        return True

    def house(self, plot: _Plot, setback: float) -> bool:
        """Add a house to a plot, a smaller one where a large one does not fit."""
        rng = self.rng
        storeys = int(rng.choice([1, 2, 3, 4], p=[0.15, 0.4, 0.3, 0.15]))
        for shrink in (1.0, 0.65):
            width, depth = shrink * plot.width, shrink * rng.uniform(8.0, 14.0)
            house = buildings.house(
                rng, width=width, depth=depth, storeys=storeys, forecourt=setback - PAVEMENT
            )
            yaw = plot.yaw + rng.normal(0.0, 0.03)
            size = (width - 0.6, depth - 0.6)
            if self.add(house, plot.position(0.0, setback), yaw, size, 0.5 * depth):
                return True
        return False

    def tree(self, position: Vector, leaves: float = 1.0) -> None:
        """Add a broad-leaved tree or a conifer."""
        rng = self.rng
        height = rng.uniform(3.5, 12.0)
        if rng.random() < 0.25:
            tree = plants.conifer(
                rng, height=height, radius=height * rng.uniform(0.15, 0.25), leaves=leaves
            )
        else:
            tree = plants.tree(
                rng,
                height=height,
                crown_radius=height * rng.uniform(0.2, 0.35),
                trunk_radius=0.02 * height * rng.uniform(0.7, 1.4),
                leaves=leaves,
            )
        self.add(tree, position, rng.uniform(0.0, 2.0 * np.pi), (1.2, 1.2))

    def shrub(self, position: Vector, leaves: float = 1.0) -> None:
        """Add a shrub."""
        radius = self.rng.uniform(0.35, 1.1)
        height = radius * self.rng.uniform(1.0, 2.0)
        shrub = plants.shrub(self.rng, radius=radius, height=height, leaves=leaves)
        self.add(shrub, position, self.rng.uniform(0.0, 2.0 * np.pi), (radius, radius))


def build_plots(
    rng: np.random.Generator, world_builder: WorldBuilder, site: Site, roads: RoadNetwork
) -> None:
    """Add plots on both sides of every road, and then objects on the land behind them."""
    builder = _PlotBuilder(rng, world_builder, site, roads)
    for road in roads.roads:
        for side in (-1.0, 1.0):
            along = rng.uniform(0.0, 6.0)
            setback = rng.uniform(PAVEMENT + 0.3, 6.0)
            while along < road.track.length - 5.0:
                width = rng.uniform(7.0, 19.0)
                plot = _Plot(road=road, side=side, along=along + 0.5 * width, width=width)
                # Half of the houses are in line with their neighbours.
                if rng.random() < 0.5:
                    setback = rng.uniform(PAVEMENT + 0.3, 9.0)
                _build_plot(builder, plot, setback + rng.normal(0.0, 0.25))
                terraced = rng.random() < 0.25
                along += width + (0.0 if terraced else 1.0 + rng.exponential(3.5))
    _fill_hinterland(builder, site, roads)


def _build_plot(builder: _PlotBuilder, plot: _Plot, setback: float) -> None:
    rng = builder.rng
    setback = max(setback, PAVEMENT + 0.3)
    if rng.random() < 0.8 and builder.house(plot, setback):
        _edge_garden(builder, plot, setback)
    else:
        _leave_open(builder, plot)
    if rng.random() < 0.3 and setback > 5.5:
        x = rng.uniform(-0.4, 0.4) * plot.width
        yaw = plot.yaw + 0.5 * np.pi + rng.normal(0.0, 0.05)
        builder.park(plot.position(x, setback - 2.6), yaw)


def _edge_garden(builder: _PlotBuilder, plot: _Plot, setback: float) -> None:
    """Add a hedge, fence, wall or shrubs between pavement and house, and plants behind them."""
    rng = builder.rng
    y = PAVEMENT + rng.uniform(0.45, 0.8)
    if setback > y + 0.8:
        length = plot.width * rng.uniform(0.35, 0.8)
        x = rng.uniform(-0.5, 0.5) * (plot.width - length)
        kind = rng.choice(
            ["hedge", "fence", "wall", "shrubs", "none"], p=[0.25, 0.15, 0.15, 0.3, 0.15]
        )
        position = plot.position(x, y)
        if kind == "hedge":
            width, height = rng.uniform(0.5, 0.9), rng.uniform(0.7, 1.9)
            hedge = plants.hedge(rng, length=length, width=width, height=height)
            builder.add(hedge, position, plot.yaw, (length, 0.4))
        elif kind == "fence":
            fence = furniture.fence(rng, length=length)
            builder.add(fence, position, plot.yaw, (length, 0.2))
        elif kind == "wall":
            wall = furniture.garden_wall(rng, length=length)
            builder.add(wall, position, plot.yaw, (length, 0.2))
        elif kind == "shrubs":
            for _ in range(int(rng.integers(1, 6))):
                builder.shrub(
                    plot.position(rng.uniform(-0.5, 0.5) * plot.width, y + rng.uniform(0, 0.8))
                )
    if setback > 4.5:
        for _ in range(int(rng.integers(0, 5))):
            x, depth = rng.uniform(-0.5, 0.5) * plot.width, rng.uniform(y + 0.7, setback - 0.7)
            add = builder.tree if rng.random() < 0.4 else builder.shrub
            add(plot.position(x, depth))


def _leave_open(builder: _PlotBuilder, plot: _Plot) -> None:
    """Add trees and shrubs, or parked cars, to a plot without a house."""
    rng = builder.rng
    if rng.random() < 0.3:
        for x in np.arange(-0.5 * plot.width + 1.5, 0.5 * plot.width - 1.0, rng.uniform(2.5, 3.1)):
            if rng.random() < 0.75:
                yaw = plot.yaw + rng.choice([-0.5, 0.5]) * np.pi + rng.normal(0.0, 0.03)
                position = plot.position(float(x), PAVEMENT + 4.5 + rng.normal(0.0, 0.3))
                builder.park(position, yaw)
        return
    for _ in range(int(rng.integers(2, 8))):
        position = plot.position(rng.uniform(-0.5, 0.5) * plot.width, rng.uniform(3.0, 14.0))
        add = builder.tree if rng.random() < 0.5 else builder.shrub
        add(position)


def _fill_hinterland(builder: _PlotBuilder, site: Site, roads: RoadNetwork) -> None:
    """Add houses, sheds, trees and shrubs to the land behind the first row."""
    rng = builder.rng
    positions = rng.uniform(site.low, site.high, (1900, 2))
    distances = roads.kerb_distance(positions)
    behind = (distances > 8.0) & (distances < _MAX_DISTANCE)
    for position, distance in zip(positions[behind], distances[behind], strict=True):
        kind = rng.random()
        leaves = 1.0 if distance < _DETAIL_DISTANCE else 0.3
        if kind < 0.25 and distance > 24.0:
            width, depth = rng.uniform(8.0, 24.0), rng.uniform(8.0, 16.0)
            storeys = int(rng.integers(1, 6))
            house = buildings.house(rng, width=width, depth=depth, storeys=storeys, forecourt=2.0)
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            builder.add(house, position, yaw, (width, depth), 0.5 * depth, margin=2.0)
        elif kind < 0.32:
            width, depth = rng.uniform(2.5, 7.0), rng.uniform(2.5, 6.5)
            shed = buildings.shed(rng, width=width, depth=depth)
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            builder.add(shed, position, yaw, (width, depth), 0.5 * depth, margin=0.5)
        elif kind < 0.7:
            builder.tree(position, leaves)
        else:
            builder.shrub(position, leaves)
