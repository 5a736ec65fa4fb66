"""A residential street that leads around a block, with houses, gardens, cars and people."""

import numpy as np

from scanlock.arrays import Vector
from scanlock.simulation.drive import CAR, Drive
from scanlock.simulation.objects import furniture, plants, traffic
from scanlock.simulation.scenes.height_field import HeightField
from scanlock.simulation.scenes.plots import build_plots
from scanlock.simulation.scenes.roads import PAVEMENT, Road, RoadNetwork
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, parked, standing
from scanlock.simulation.scenes.stage import Stage, around
from scanlock.simulation.scenes.terrain import Waves
from scanlock.simulation.scenes.track import Track

_MARGIN = 110.0
"""How far the ground goes on beyond the loop [m]."""

_LANE = 1.65
"""From the middle of the road to the middle of a lane [m]; traffic keeps to the right."""


def street(rng: np.random.Generator, *, traffic_speed: float = CAR.speed) -> Scene:
    """Return a block of houses with a loop of street around it, about 850 m long.

    Everything is drawn: the course of the loop and the streets off it, slopes, houses with
    uneven fronts, gardens, hedges, fences, trees, street furniture, parked and moving cars and
    people on foot. No two stretches are alike.

    Parameters
    ----------
    rng : Generator
        Decides everything about the street.
    traffic_speed : float [m/s]
        Speed of the cars that share the lane of the track, and about that of those that come
        the other way.
    """
    roads = RoadNetwork(rng, _MARGIN)
    ground = HeightField.sampled(roads.height, roads.low, roads.high, cell=1.0)
    site = Site(roads.low, roads.high)
    site.block(roads.gap(site.cells()) < PAVEMENT + 0.2)

    stage = Stage()
    stage.put(roads.pavements())
    for road in roads.roads:
        for side in (-1.0, 1.0):
            _line_kerb(rng, stage, roads, road, side)
            _park_cars(rng, stage, roads, road, side)
    build_plots(rng, stage, site, roads)
    lane = roads.loop.track.beside(-_LANE)
    _set_traffic_going(rng, stage, roads, lane, traffic_speed)
    return Scene("street", stage.world(ground), lane, CAR)


def street_drive(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.85,
    start: float = 0.0,
) -> Drive:
    """Return the poses of a car around the loop, one a tenth of a second at the usual speed."""
    return scene.drive(rng, count=count, spacing=spacing, start=start)


def _line_kerb(
    rng: np.random.Generator, stage: Stage, roads: RoadNetwork, road: Road, side: float
) -> None:
    """Put lamps, signs, trees and bollards on the pavement of one side of a road."""
    wooded = Waves.drawn(rng, 1.0, 40.0, 200.0)
    for what, least, mean in (
        ("lamp", 16.0, 14.0),
        ("sign", 6.0, 22.0),
        ("tree", 5.0, 9.0),
        ("bollards", 30.0, 120.0),
        ("bins", 8.0, 30.0),
        ("pole", 25.0, 60.0),
    ):
        along = rng.uniform(2.0, least + mean)
        while along < road.track.length - 3.0:
            out = road.half_width + rng.uniform(0.4, 0.8 if what != "bins" else 1.8)
            place = road.track.at(along, side * out)
            bare = what == "tree" and wooded.at(np.array([[along, 0.0]]))[0] < -0.2
            if not bare and roads.gap(place)[0] > 0.3:
                # Arms and faces point back at the road.
                yaw = road.track.heading(along)[0] + (np.pi if side > 0 else 0.0)
                _put_kerbside(rng, stage, what, np.array([*place[0], roads.level(place)[0]]), yaw)
            along += least + rng.exponential(mean)


def _put_kerbside(
    rng: np.random.Generator, stage: Stage, what: str, place: Vector, yaw: float
) -> None:
    yaw += rng.normal(0.0, 0.06)
    if what == "lamp":
        thing = furniture.street_lamp(rng)
    elif what == "sign":
        thing = furniture.traffic_sign(rng)
    elif what == "pole":
        pick = furniture.wooden_pole if rng.random() < 0.7 else furniture.traffic_light
        thing = pick(rng)
    elif what == "bollards":
        thing = furniture.bollards(rng, int(rng.integers(3, 8)))
    elif what == "bins":
        thing = furniture.bins(rng, int(rng.integers(1, 4)))
    else:
        height = rng.uniform(5.0, 11.0)
        thing = plants.tree(
            rng,
            height=height,
            crown_radius=height * rng.uniform(0.2, 0.33),
            trunk_radius=0.02 * height * rng.uniform(0.7, 1.4),
        )
        yaw = rng.uniform(0.0, 2.0 * np.pi)
    stage.put(thing, standing(place, yaw))


def _park_cars(
    rng: np.random.Generator, stage: Stage, roads: RoadNetwork, road: Road, side: float
) -> None:
    """Park cars along one kerb, in uneven rows with gaps at the mouths of other streets."""
    wanted = Waves.drawn(rng, 1.0, 50.0, 250.0)
    stations = np.arange(0.0, road.track.length)
    kerb = road.track.at(stations, side * (road.half_width - 1.0))
    clear = roads.gap_to_others(road, kerb)
    along = rng.uniform(3.0, 12.0)
    while along < road.track.length - 4.0:
        out = road.half_width - 1.0 + rng.normal(0.0, 0.07)
        place = road.track.at(along, side * out)
        busy = wanted.at(np.array([[along, 0.0]]))[0] > 0.1
        narrow = road.half_width < 3.1
        if busy and not narrow and np.interp(along, stations, clear) > 4.5:
            yaw = road.track.heading(along)[0] + rng.normal(0.0, 0.02)
            if side > 0 or rng.random() < 0.1:
                yaw += np.pi
            stage.put(traffic.car(rng), parked(roads.level, place[0], yaw))
            along += 5.2 + rng.uniform(0.3, 2.5)
        else:
            along += rng.uniform(3.0, 9.0)


def _set_traffic_going(
    rng: np.random.Generator, stage: Stage, roads: RoadNetwork, lane: Track, speed: float
) -> None:
    """Set cars going in both lanes of the loop, and people walking on its pavements."""
    # Along the track itself: ahead of and behind where it starts at time 0.
    for start in (rng.uniform(18.0, 45.0), -rng.uniform(14.0, 40.0), rng.uniform(80.0, 200.0)):
        stage.set_going(traffic.car(rng), _on_top(roads, lane), start, speed)
    oncoming = lane.beside(2.0 * _LANE).reversed()
    start = rng.uniform(0.0, 60.0)
    while start < oncoming.length - 30.0:
        stage.set_going(traffic.car(rng), _on_top(roads, oncoming), start, 0.9 * speed)
        start += 25.0 + rng.exponential(70.0)
    for side in (-1.0, 1.0):
        out = roads.loop.half_width + 0.7 * PAVEMENT
        walk = roads.loop.track.beside(side * out)
        walks = (_on_top(roads, walk), _on_top(roads, walk.reversed()))
        start = rng.uniform(0.0, 40.0)
        while start < walk.length:
            path = walks[int(rng.integers(2))]
            stage.set_going(traffic.person(rng), path, start, rng.uniform(0.8, 1.7))
            start += 4.0 + rng.exponential(35.0)


def _on_top(roads: RoadNetwork, track: Track) -> np.ndarray:
    places = track.points[::2]
    return around(np.column_stack([places, roads.level(places)]))
