"""Road network of a block: a loop, side streets, kerbs, pavements and the terrain below."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from scanlock.arrays import Matrix, Points, Vector
from scanlock.simulation.objects.shapes import triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.terrain.waves import Waves, smoothstep

KERB = 0.13
"""Height of a pavement above the road [m]."""

PAVEMENT = 2.2
"""Width of a pavement [m]."""

_MAX_DISTANCE = 85.0
"""Maximum distance from a road that is computed [m]."""

_PIECE = 1.5
"""Length of a segment of kerb [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """A street between two kerbs."""

    track: Track
    """Centre line."""

    half_width: float
    """Half the distance between the kerbs [m]."""


class RoadNetwork:
    """A closed street with side streets, and the terrain around them.

    Attributes
    ----------
    roads : list of Road
        The anticlockwise loop, then the side streets, which begin at the loop.
    low, high : (2,) [m]
        Corners of the terrain.
    """

    def __init__(self, rng: np.random.Generator, margin: float) -> None:
        loop = Road(_loop(rng), rng.uniform(5.4, 6.4))
        self.roads = [loop, *_side_roads(rng, loop)]
        self.low = loop.track.points.min(axis=0) - margin
        self.high = loop.track.points.max(axis=0) + margin
        self._distances = HeightField.sampled(
            lambda positions: _kerb_distance(self.roads, positions), self.low, self.high, cell=1.0
        )
        self._hills = Waves.drawn(rng, rng.uniform(0.8, 1.6), 120.0, 400.0)
        self._roughness = Waves.drawn(rng, 0.006, 2.0, 8.0)
        self._lawns = Waves.drawn(rng, 0.06, 3.0, 12.0)

    @property
    def loop(self) -> Road:
        """The closed street."""
        return self.roads[0]

    def kerb_distance(self, positions: Matrix) -> Vector:
        """Return the (n,) distances from the nearest kerb, negative on a road [m].

        They are interpolated from a grid of 1 m, with errors of centimetres near a road.
        """
        return self._distances.at(positions)

    def other_kerb_distance(self, road: Road, positions: Matrix) -> Vector:
        """Return the (n,) distances from the nearest kerb of all other roads [m]."""
        return _kerb_distance([other for other in self.roads if other is not road], positions)

    def terrain_height(self, positions: Matrix) -> Vector:
        """Return the (n,) heights of the terrain, without the pavements above it [m]."""
        return self._height(positions, self.kerb_distance(positions))

    def surface_height(self, positions: Matrix) -> Vector:
        """Return the (n,) heights of the terrain or the pavement [m]."""
        distances = self.kerb_distance(positions)
        paved = (distances > 0) & (distances < PAVEMENT)
        return np.where(paved, self._hills.at(positions) + KERB, self._height(positions, distances))

    def _height(self, positions: Matrix, distances: Vector) -> Vector:
        # The step up to the lawns is below the pavement.
        step = (KERB - 0.015) * smoothstep(distances, 0.3, 1.4)
        camber = 0.015 * np.maximum(-distances, 0.0)
        rough = self._roughness.at(positions) * smoothstep(-distances, 0.0, 0.5)
        lawn = self._lawns.at(positions) * smoothstep(distances, PAVEMENT + 0.3, PAVEMENT + 2.0)
        return self._hills.at(positions) + step + camber + rough + lawn

    def pavements(self) -> Surfaces:
        """Return kerbs and pavements on both sides of every road, with openings at junctions."""
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
        others = self.other_kerb_distance(road, 0.5 * (middle[:-1] + middle[1:]))
        own = self.kerb_distance(middle[:-1])
        selected = np.flatnonzero((others > 0.2) & (own > 0.2))
        base = self._above_hills(inner, -0.1)
        low, high = self._above_hills(inner, KERB), self._above_hills(outer, KERB)
        top = _quads(low[:-1], low[1:], high[1:], high[:-1], selected)
        face = _quads(base[:-1], base[1:], low[1:], low[:-1], selected)
        return Surfaces.joined(
            [triangles(top, SurfaceClass.GROUND), triangles(face, SurfaceClass.KERB)]
        )

    def _above_hills(self, positions: Matrix, height: float) -> Points:
        return np.column_stack([positions, self._hills.at(positions) + height])


def _kerb_distance(roads: list[Road], positions: Matrix) -> Vector:
    """Return the (n,) distances from the nearest kerb of some roads, at most `_MAX_DISTANCE`."""
    nearest = np.full(len(positions), _MAX_DISTANCE)
    for road in roads:
        tree = KDTree(road.track.points)
        distances, _ = tree.query(positions, distance_upper_bound=_MAX_DISTANCE + road.half_width)
        nearest = np.minimum(nearest, distances - road.half_width)
    return nearest


def _quads(a: Points, b: Points, c: Points, d: Points, selected: np.ndarray) -> Points:
    """Return the corners of two triangles for each selected quadrilateral abcd."""
    first = np.stack([a, b, c], axis=1)[selected]
    second = np.stack([a, c, d], axis=1)[selected]
    return np.concatenate([first, second])


def _loop(rng: np.random.Generator) -> Track:
    """Generate the centre line around an irregular block, of about 850 m."""
    half = np.array([rng.uniform(115.0, 140.0), rng.uniform(70.0, 90.0)])
    # fmt: off
    corners = np.array([[-1, -1], [-0.3, -1], [0.3, -1], [1, -1], [1, 0],
                        [1, 1], [0.3, 1], [-0.3, 1], [-1, 1], [-1, 0]]) * half
    # fmt: on
    return Track.round(corners + rng.uniform(-16.0, 16.0, corners.shape), bend=6.0)


def _side_roads(rng: np.random.Generator, loop: Road) -> list[Road]:
    """Generate streets outwards from the loop, and some across the block."""
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
    length = 105.0
    if side > 0:
        # Across the block, up to the street on its other side.
        away = np.arange(25.0, 320.0, 1.0)
        nearest = KDTree(loop.track.points).query(start + away[:, None] * direction)[0]
        length = away[np.argmax(nearest < 2.0)] if (nearest < 2.0).any() else 60.0
    return Road(Track.straight(start, start + length * direction), rng.uniform(2.8, 3.5))
