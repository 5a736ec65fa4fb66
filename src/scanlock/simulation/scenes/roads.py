"""A block of streets: a loop, side streets off it, kerbs, pavements and the ground below."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Points, Vector
from scanlock.simulation.objects.shapes import triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.terrain import Waves, ramp
from scanlock.simulation.scenes.track import Track

KERB = 0.13
"""Height of a pavement above the road [m]."""

PAVEMENT = 2.2
"""Width of a pavement [m]."""

_REACH = 85.0
"""Farther from a road than this [m] it does not matter how far."""

_PIECE = 1.5
"""Length of a piece of kerb [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """A street: its centre line and half its width between the kerbs [m]."""

    track: Track
    half_width: float


class RoadNetwork:
    """A loop of street with side streets, and how high the ground is about them.

    Attributes
    ----------
    roads : list of Road
        The loop first, run anticlockwise, then the side streets, each starting at the loop.
    low, high : (2,) [m]
        Corners of the land around them.
    """

    def __init__(self, rng: np.random.Generator, margin: float) -> None:
        loop = Road(_loop(rng), rng.uniform(5.4, 6.4))
        self.roads = [loop, *_side_roads(rng, loop)]
        self.low = loop.track.points.min(axis=0) - margin
        self.high = loop.track.points.max(axis=0) + margin
        self._gaps = HeightField.sampled(
            lambda places: _gap_to(self.roads, places), self.low, self.high, cell=1.0
        )
        self._hills = Waves.drawn(rng, rng.uniform(0.8, 1.6), 120.0, 400.0)
        self._roughness = Waves.drawn(rng, 0.006, 2.0, 8.0)
        self._lawns = Waves.drawn(rng, 0.06, 3.0, 12.0)

    @property
    def loop(self) -> Road:
        """The street that leads back to its start."""
        return self.roads[0]

    def gap(self, places: Matrix) -> Vector:
        """Return how far (n, 2+) places are from the nearest kerb, negative on a road [m].

        Interpolated from a grid of a metre, so good to centimetres near a road.
        """
        return self._gaps.at(places)

    def gap_to_others(self, road: Road, places: Matrix) -> Vector:
        """Return the same with one road left out."""
        return _gap_to([other for other in self.roads if other is not road], places)

    def height(self, places: Matrix) -> Vector:
        """Return the height of the bare ground (n,), which the pavements cover in part [m]."""
        return self._height(places, self.gap(places))

    def level(self, places: Matrix) -> Vector:
        """Return the height (n,) of what one stands on: ground or pavement [m]."""
        gaps = self.gap(places)
        paved = (gaps > 0) & (gaps < PAVEMENT)
        return np.where(paved, self._hills.at(places) + KERB, self._height(places, gaps))

    def _height(self, places: Matrix, gaps: Vector) -> Vector:
        # The step up to the lawns hides below the pavement.
        raised = (KERB - 0.015) * ramp(gaps, 0.3, 1.4)
        camber = 0.015 * np.maximum(-gaps, 0.0)
        rough = self._roughness.at(places) * ramp(-gaps, 0.0, 0.5)
        lawn = self._lawns.at(places) * ramp(gaps, PAVEMENT + 0.3, PAVEMENT + 2.0)
        return self._hills.at(places) + raised + camber + rough + lawn

    def pavements(self) -> Surfaces:
        """Return kerbs and pavements along both sides of every road, open where roads meet."""
        parts: list[Surfaces] = []
        for road in self.roads:
            along = np.arange(0.0, road.track.length, _PIECE)
            if road.track.is_closed:
                along = np.append(along, road.track.length)
            for side in (-1.0, 1.0):
                edges = [
                    road.track.at(along, side * (road.half_width + out)) for out in (0.0, PAVEMENT)
                ]
                parts.append(self._strip(road, edges))
        return Surfaces.joined(parts)

    def _strip(self, road: Road, edges: list[Matrix]) -> Surfaces:
        inner, outer = edges
        middle = 0.5 * (inner + outer)
        others = self.gap_to_others(road, 0.5 * (middle[:-1] + middle[1:]))
        own = self.gap(middle[:-1])
        kept = np.flatnonzero((others > 0.2) & (own > 0.2))
        base = self._lifted(inner, -0.1)
        low, high = self._lifted(inner, KERB), self._lifted(outer, KERB)
        top = _quads(low[:-1], low[1:], high[1:], high[:-1], kept)
        face = _quads(base[:-1], base[1:], low[1:], low[:-1], kept)
        return Surfaces.joined(
            [triangles(top, SurfaceClass.GROUND), triangles(face, SurfaceClass.KERB)]
        )

    def _lifted(self, places: Matrix, above: float) -> Points:
        return np.column_stack([places, self._hills.at(places) + above])


def _gap_to(roads: list[Road], places: Matrix) -> Vector:
    """Return how far (n, 2) places are from the nearest kerb of some roads, at most `_REACH`."""
    gaps = np.full(len(places), _REACH)
    for road in roads:
        tree = KDTree(road.track.points)
        distances, _ = tree.query(places, distance_upper_bound=_REACH + road.half_width)
        gaps = np.minimum(gaps, distances - road.half_width)
    return gaps


def _quads(a: Points, b: Points, c: Points, d: Points, kept: np.ndarray) -> Points:
    """Return the corners of two triangles for each kept quadrilateral abcd."""
    first = np.stack([a, b, c], axis=1)[kept]
    second = np.stack([a, c, d], axis=1)[kept]
    return np.concatenate([first, second])


def _loop(rng: np.random.Generator) -> Track:
    """Return the centre line around an uneven block, about 850 m long."""
    half = np.array([rng.uniform(115.0, 140.0), rng.uniform(70.0, 90.0)])
    # fmt: off
    corners = np.array([[-1, -1], [-0.3, -1], [0.3, -1], [1, -1], [1, 0],
                        [1, 1], [0.3, 1], [-0.3, 1], [-1, 1], [-1, 0]]) * half
    # fmt: on
    return Track.round(corners + rng.uniform(-16.0, 16.0, corners.shape), bend=6.0)


def _side_roads(rng: np.random.Generator, loop: Road) -> list[Road]:
    """Return streets that leave the loop outwards, and some across the block."""
    roads: list[Road] = []
    along = rng.uniform(15.0, 40.0)
    while along < loop.track.length - 25.0:
        bend = np.ptp(loop.track.heading(along + np.linspace(-18.0, 18.0, 7)))
        if bend < 0.45:
            side = -1.0 if rng.random() < 0.65 else 1.0
            roads.append(_side_road(rng, loop, along, side))
            along += rng.uniform(38.0, 95.0)
        else:
            along += 10.0
    return roads


def _side_road(rng: np.random.Generator, loop: Road, along: float, side: float) -> Road:
    start = loop.track.at(along)[0]
    angle = loop.track.heading(along)[0] + side * 0.5 * np.pi + rng.uniform(-0.25, 0.25)
    direction = np.array([np.cos(angle), np.sin(angle)])
    reach = 105.0
    if side > 0:
        # Into the block: as far as the street on the other side of it.
        away = np.arange(25.0, 320.0, 1.0)
        nearest = KDTree(loop.track.points).query(start + away[:, None] * direction)[0]
        reach = away[np.argmax(nearest < 2.0)] if (nearest < 2.0).any() else 60.0
    return Road(Track.straight(start, start + reach * direction), rng.uniform(2.8, 3.5))
