"""Residential street around a block, with houses, gardens, traffic and pedestrians."""

import numpy as np

from scanlock.arrays import Vector
from scanlock.simulation.drive import CAR, Drive
from scanlock.simulation.objects import furniture, plants, traffic
from scanlock.simulation.scenes.plots import build_plots
from scanlock.simulation.scenes.roads import PAVEMENT, Road, RoadNetwork
from scanlock.simulation.scenes.scene import Scene
from scanlock.simulation.scenes.site import Site, car_pose, upright_pose
from scanlock.simulation.scenes.world_builder import WorldBuilder, closed
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.terrain.track import Track
from scanlock.simulation.terrain.waves import Waves

_MARGIN = 110.0
"""Extent of the terrain beyond the loop [m]."""

_LANE = 1.65
"""Offset of a lane from the centre line of the road [m]; traffic drives on the right."""


def street(rng: np.random.Generator, *, traffic_speed: float = CAR.speed) -> Scene:
    """Generate a block of houses with a closed street of about 850 m around it.

    All of it is random: the loop and the side streets, slopes, houses with uneven fronts, gardens,
    hedges, fences, trees, street furniture, parked and moving cars, and pedestrians. No two
    sections are the same.

    Parameters
    ----------
    rng : Generator
        Source of all random choices.
    traffic_speed : float [m/s]
        Speed of the cars in the lane of the track; oncoming cars are 10 % slower.

    Returns
    -------
    Scene
    """
    roads = RoadNetwork(rng, _MARGIN)
    ground = HeightField.sampled(roads.terrain_height, roads.low, roads.high, cell=1.0)
    site = Site(roads.low, roads.high)
    site.block(roads.kerb_distance(site.cells()) < PAVEMENT + 0.2)

    builder = WorldBuilder()
    builder.add(roads.pavements())
    for road in roads.roads:
        for side in (-1.0, 1.0):
            _line_kerb(rng, builder, roads, road, side)
            _park_cars(rng, builder, roads, road, side)
    build_plots(rng, builder, site, roads)
    lane = roads.loop.track.beside(-_LANE)
    _add_traffic(rng, builder, roads, lane, traffic_speed)
    return Scene(name="street", world=builder.world(ground), track=lane, carrier=CAR)


def street_drive(
    scene: Scene,
    rng: np.random.Generator,
    *,
    count: int = 1000,
    spacing: float = 0.85,
    start: float = 0.0,
) -> Drive:
    """Simulate a car on the loop.

    Parameters
    ----------
    scene, rng, count, spacing, start
        As for `drive_along`; the default spacing is that of 0.1 s at the speed of the car.

    Returns
    -------
    Drive
    """
    return scene.drive(rng, count=count, spacing=spacing, start=start)


def _line_kerb(
    rng: np.random.Generator, builder: WorldBuilder, roads: RoadNetwork, road: Road, side: float
) -> None:
    """Add lamps, signs, trees and bollards to the pavement on one side of a road."""
    density = Waves.drawn(rng, 1.0, 40.0, 200.0)
    for kind, min_gap, mean_gap in (
        ("lamp", 16.0, 14.0),
        ("sign", 6.0, 22.0),
        ("tree", 5.0, 9.0),
        ("bollards", 30.0, 120.0),
        ("bins", 8.0, 30.0),
        ("pole", 25.0, 60.0),
    ):
        along = rng.uniform(2.0, min_gap + mean_gap)
        while along < road.track.length - 3.0:
            out = road.half_width + rng.uniform(0.4, 0.8 if kind != "bins" else 1.8)
            position = road.track.at(along, side * out)
            bare = kind == "tree" and density.at(np.array([[along, 0.0]]))[0] < -0.2
            if not bare and roads.kerb_distance(position)[0] > 0.3:
                # Arms and signs face the road.
                yaw = road.track.heading(along)[0] + (np.pi if side > 0 else 0.0)
                foot = np.array([*position[0], roads.surface_height(position)[0]])
                _add_kerbside(rng, builder, kind, foot, yaw)
            along += min_gap + rng.exponential(mean_gap)


def _add_kerbside(
    rng: np.random.Generator, builder: WorldBuilder, kind: str, position: Vector, yaw: float
) -> None:
    yaw += rng.normal(0.0, 0.06)
    if kind == "lamp":
        surfaces = furniture.street_lamp(rng)
    elif kind == "sign":
        surfaces = furniture.traffic_sign(rng)
    elif kind == "pole":
        make = furniture.wooden_pole if rng.random() < 0.7 else furniture.traffic_light
        surfaces = make(rng)
    elif kind == "bollards":
        surfaces = furniture.bollards(rng, int(rng.integers(3, 8)))
    elif kind == "bins":
        surfaces = furniture.bins(rng, int(rng.integers(1, 4)))
    else:
        height = rng.uniform(5.0, 11.0)
        surfaces = plants.tree(
            rng,
            height=height,
            crown_radius=height * rng.uniform(0.2, 0.33),
            trunk_radius=0.02 * height * rng.uniform(0.7, 1.4),
        )
        yaw = rng.uniform(0.0, 2.0 * np.pi)
    builder.add(surfaces, upright_pose(position, yaw))


def _park_cars(
    rng: np.random.Generator, builder: WorldBuilder, roads: RoadNetwork, road: Road, side: float
) -> None:
    """Add parked cars along one kerb, with uneven spacing and gaps at junctions."""
    density = Waves.drawn(rng, 1.0, 50.0, 250.0)
    stations = np.arange(0.0, road.track.length)
    kerb = road.track.at(stations, side * (road.half_width - 1.0))
    clear = roads.other_kerb_distance(road, kerb)
    along = rng.uniform(3.0, 12.0)
    while along < road.track.length - 4.0:
        out = road.half_width - 1.0 + rng.normal(0.0, 0.07)
        position = road.track.at(along, side * out)
        busy = density.at(np.array([[along, 0.0]]))[0] > 0.1
        narrow = road.half_width < 3.1
        if busy and not narrow and np.interp(along, stations, clear) > 4.5:
            yaw = road.track.heading(along)[0] + rng.normal(0.0, 0.02)
            if side > 0 or rng.random() < 0.1:
                yaw += np.pi
            builder.add(traffic.car(rng), car_pose(roads.surface_height, position[0], yaw))
            along += 5.2 + rng.uniform(0.3, 2.5)
        else:
            along += rng.uniform(3.0, 9.0)


def _add_traffic(
    rng: np.random.Generator, builder: WorldBuilder, roads: RoadNetwork, lane: Track, speed: float
) -> None:
    """Add cars in both lanes of the loop, and pedestrians on its pavements."""
    # In the lane of the track, ahead of and behind its position at time 0.
    for start in (rng.uniform(18.0, 45.0), -rng.uniform(14.0, 40.0), rng.uniform(80.0, 200.0)):
        builder.add_mover(traffic.car(rng), _on_surface(roads, lane), start, speed)
    oncoming = lane.beside(2.0 * _LANE).reversed()
    start = rng.uniform(0.0, 60.0)
    while start < oncoming.length - 30.0:
        builder.add_mover(traffic.car(rng), _on_surface(roads, oncoming), start, 0.9 * speed)
        start += 25.0 + rng.exponential(70.0)
    for side in (-1.0, 1.0):
        out = roads.loop.half_width + 0.7 * PAVEMENT
        walk = roads.loop.track.beside(side * out)
        walks = (_on_surface(roads, walk), _on_surface(roads, walk.reversed()))
        start = rng.uniform(0.0, 40.0)
        while start < walk.length:
            path = walks[int(rng.integers(2))]
            builder.add_mover(traffic.person(rng), path, start, rng.uniform(0.8, 1.7))
            start += 4.0 + rng.exponential(35.0)


def _on_surface(roads: RoadNetwork, track: Track) -> np.ndarray:
    """Return the closed (k, 3) path of a track on the surface of roads and pavements [m]."""
    positions = track.points[::2]
    return closed(np.column_stack([positions, roads.surface_height(positions)]))
