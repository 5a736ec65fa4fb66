"""What stands beside the streets of a block: houses, gardens, yards and what is behind them."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.simulation.objects import buildings, furniture, plants, traffic
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.roads import PAVEMENT, Road, RoadNetwork
from scanlock.simulation.scenes.site import Site, parked, standing
from scanlock.simulation.scenes.stage import Stage

_CLOSE = 25.0
"""Plants farther from a street than this [m] have fewer and larger leaves."""

_FAR = 80.0
"""Nothing stands farther from a street than this [m]."""


@dataclass(frozen=True, slots=True)
class _Plot:
    """A stretch of one side of a road: x along it, y away from it."""

    road: Road
    side: float
    along: float
    width: float

    @property
    def yaw(self) -> float:
        heading = float(self.road.track.heading(self.along)[0])
        return heading if self.side > 0 else heading + np.pi

    def place(self, x: float, y: float) -> Vector:
        """Return the (2,) place x to the left or right of the middle, y behind the kerb."""
        along = self.along + self.side * x
        return self.road.track.at(along, self.side * (self.road.half_width + y))[0]


class _Builder:
    """Puts things on plots, each on free ground and at the height of the ground."""

    def __init__(
        self, rng: np.random.Generator, stage: Stage, site: Site, roads: RoadNetwork
    ) -> None:
        self.rng = rng
        self._stage = stage
        self._site = site
        self._roads = roads

    def put(
        self,
        thing: Surfaces,
        place: Vector,
        yaw: float,
        size: tuple[float, float],
        origin: float = 0.0,
        margin: float = 0.0,
    ) -> bool:
        """Put a thing down if its footprint, `origin` [m] behind its place, is free."""
        middle = place + origin * np.array([-np.sin(yaw), np.cos(yaw)])
        if not self._site.claim(middle, yaw, *size, margin=margin):
            return False
        height = self._roads.level(np.atleast_2d(place))[0]
        self._stage.put(thing, standing(np.array([*place, height]), yaw))
        return True

    def park(self, place: Vector, yaw: float) -> bool:
        """Park a car if there is room."""
        if not self._site.claim(place, yaw, 4.6, 1.8):
            return False
        self._stage.put(traffic.car(self.rng), parked(self._roads.level, place, yaw))
        return True

    def house(self, plot: _Plot, setback: float) -> bool:
        """Build a house on a plot, a smaller one where a large one does not fit."""
        rng = self.rng
        storeys = int(rng.choice([1, 2, 3, 4], p=[0.15, 0.4, 0.3, 0.15]))
        for shrink in (1.0, 0.65):
            width, depth = shrink * plot.width, shrink * rng.uniform(8.0, 14.0)
            thing = buildings.house(
                rng, width=width, depth=depth, storeys=storeys, forecourt=setback - PAVEMENT
            )
            yaw = plot.yaw + rng.normal(0.0, 0.03)
            size = (width - 0.6, depth - 0.6)
            if self.put(thing, plot.place(0.0, setback), yaw, size, 0.5 * depth):
                return True
        return False

    def tree(self, place: Vector, leaves: float = 1.0) -> None:
        """Plant a tree of some kind."""
        rng = self.rng
        height = rng.uniform(3.5, 12.0)
        if rng.random() < 0.25:
            thing = plants.conifer(
                rng, height=height, radius=height * rng.uniform(0.15, 0.25), leaves=leaves
            )
        else:
            thing = plants.tree(
                rng,
                height=height,
                crown_radius=height * rng.uniform(0.2, 0.35),
                trunk_radius=0.02 * height * rng.uniform(0.7, 1.4),
                leaves=leaves,
            )
        self.put(thing, place, rng.uniform(0.0, 2.0 * np.pi), (1.2, 1.2))

    def bush(self, place: Vector, leaves: float = 1.0) -> None:
        """Plant a bush."""
        radius = self.rng.uniform(0.35, 1.1)
        height = radius * self.rng.uniform(1.0, 2.0)
        thing = plants.shrub(self.rng, radius=radius, height=height, leaves=leaves)
        self.put(thing, place, self.rng.uniform(0.0, 2.0 * np.pi), (radius, radius))


def build_plots(rng: np.random.Generator, stage: Stage, site: Site, roads: RoadNetwork) -> None:
    """Build up both sides of every road, and then the land behind."""
    builder = _Builder(rng, stage, site, roads)
    for road in roads.roads:
        for side in (-1.0, 1.0):
            along = rng.uniform(0.0, 6.0)
            setback = rng.uniform(PAVEMENT + 0.3, 6.0)
            while along < road.track.length - 5.0:
                width = rng.uniform(7.0, 19.0)
                plot = _Plot(road, side, along + 0.5 * width, width)
                # Neighbours line up more often than not.
                if rng.random() < 0.5:
                    setback = rng.uniform(PAVEMENT + 0.3, 9.0)
                _build_plot(builder, plot, setback + rng.normal(0.0, 0.25))
                terraced = rng.random() < 0.25
                along += width + (0.0 if terraced else 1.0 + rng.exponential(3.5))
    _fill_hinterland(builder, site, roads)


def _build_plot(builder: _Builder, plot: _Plot, setback: float) -> None:
    rng = builder.rng
    setback = max(setback, PAVEMENT + 0.3)
    if rng.random() < 0.8 and builder.house(plot, setback):
        _edge_garden(builder, plot, setback)
    else:
        _leave_open(builder, plot)
    if rng.random() < 0.3 and setback > 5.5:
        x = rng.uniform(-0.4, 0.4) * plot.width
        yaw = plot.yaw + 0.5 * np.pi + rng.normal(0.0, 0.05)
        builder.park(plot.place(x, setback - 2.6), yaw)


def _edge_garden(builder: _Builder, plot: _Plot, setback: float) -> None:
    """Put hedge, fence, wall or bushes between pavement and house, and plants behind them."""
    rng = builder.rng
    y = PAVEMENT + rng.uniform(0.45, 0.8)
    if setback > y + 0.8:
        length = plot.width * rng.uniform(0.35, 0.8)
        x = rng.uniform(-0.5, 0.5) * (plot.width - length)
        kind = rng.choice(
            ["hedge", "fence", "wall", "bushes", "none"], p=[0.25, 0.15, 0.15, 0.3, 0.15]
        )
        place = plot.place(x, y)
        if kind == "hedge":
            width, height = rng.uniform(0.5, 0.9), rng.uniform(0.7, 1.9)
            thing = plants.hedge(rng, length=length, width=width, height=height)
            builder.put(thing, place, plot.yaw, (length, 0.4))
        elif kind == "fence":
            builder.put(furniture.fence(rng, length=length), place, plot.yaw, (length, 0.2))
        elif kind == "wall":
            builder.put(furniture.garden_wall(rng, length=length), place, plot.yaw, (length, 0.2))
        elif kind == "bushes":
            for _ in range(int(rng.integers(1, 6))):
                builder.bush(
                    plot.place(rng.uniform(-0.5, 0.5) * plot.width, y + rng.uniform(0, 0.8))
                )
    if setback > 4.5:
        for _ in range(int(rng.integers(0, 5))):
            x, depth = rng.uniform(-0.5, 0.5) * plot.width, rng.uniform(y + 0.7, setback - 0.7)
            pick = builder.tree if rng.random() < 0.4 else builder.bush
            pick(plot.place(x, depth))


def _leave_open(builder: _Builder, plot: _Plot) -> None:
    """Leave a plot to trees and bushes, or to parked cars."""
    rng = builder.rng
    if rng.random() < 0.3:
        for x in np.arange(-0.5 * plot.width + 1.5, 0.5 * plot.width - 1.0, rng.uniform(2.5, 3.1)):
            if rng.random() < 0.75:
                yaw = plot.yaw + rng.choice([-0.5, 0.5]) * np.pi + rng.normal(0.0, 0.03)
                place = plot.place(float(x), PAVEMENT + 4.5 + rng.normal(0.0, 0.3))
                builder.park(place, yaw)
        return
    for _ in range(int(rng.integers(2, 8))):
        place = plot.place(rng.uniform(-0.5, 0.5) * plot.width, rng.uniform(3.0, 14.0))
        pick = builder.tree if rng.random() < 0.5 else builder.bush
        pick(place)


def _fill_hinterland(builder: _Builder, site: Site, roads: RoadNetwork) -> None:
    """Scatter houses, sheds, trees and bushes over the land behind the first row."""
    rng = builder.rng
    places = rng.uniform(site.low, site.high, (1900, 2))
    gaps = roads.gap(places)
    behind = (gaps > 8.0) & (gaps < _FAR)
    for place, gap in zip(places[behind], gaps[behind], strict=True):
        kind = rng.random()
        leaves = 1.0 if gap < _CLOSE else 0.3
        if kind < 0.25 and gap > 24.0:
            width, depth = rng.uniform(8.0, 24.0), rng.uniform(8.0, 16.0)
            storeys = int(rng.integers(1, 6))
            thing = buildings.house(rng, width=width, depth=depth, storeys=storeys, forecourt=2.0)
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            builder.put(thing, place, yaw, (width, depth), 0.5 * depth, margin=2.0)
        elif kind < 0.32:
            width, depth = rng.uniform(2.5, 7.0), rng.uniform(2.5, 6.5)
            thing = buildings.shed(rng, width=width, depth=depth)
            yaw = rng.uniform(0.0, 2.0 * np.pi)
            builder.put(thing, place, yaw, (width, depth), 0.5 * depth, margin=0.5)
        elif kind < 0.7:
            builder.tree(place, leaves)
        else:
            builder.bush(place, leaves)
