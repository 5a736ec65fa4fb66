"""Office floors: equal rooms with doors on both sides of a corridor."""

import math

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.movables import chair, crate, planter, shelf, table, trolley
from scanlock.simulation.objects.shapes import blocks
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
)
from scanlock.simulation.scenes.repeating.visit import Visit
from scanlock.simulation.scenes.site import upright_pose

_DOOR = (0.5, 0.95, 2.05)
"""Distance of a door from the left wall of its room, its width and its height [m]."""

_WALL = 0.06
"""Half thickness of a wall [m]."""


def office_floor(
    visit: Visit,
    *,
    rooms: int = 10,
    room: float = 3.6,
    depth: float = 4.6,
    corridor: float = 2.0,
    height: float = 2.7,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate one floor of an office: equal rooms on both sides of a corridor along x.

    The doors, open or closed, are loose, and so are desks, chairs, shelves, boxes and people.

    Parameters
    ----------
    visit : Visit
        Its part is the floor.
    rooms : int
        Number of rooms on each side.
    room, depth, corridor, height : float [m]
        Width and depth of a room, width of the corridor, and height of the ceiling.
    things : float
        Factor on the number of loose things; without any, no opening has a door.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    require_count("rooms", rooms)
    for name, value in (
        ("room", room), ("depth", depth), ("corridor", corridor), ("height", height),
    ):  # fmt: skip
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    half, side = 0.5 * rooms * room, 0.5 * corridor
    outer = side + depth
    shell = [(-half, half, -outer, outer, height, height + 0.2)]
    shell += [(x - _WALL, x + _WALL, -side, side, -0.1, height) for x in (-half, half)]
    dealer.builder.add(blocks(shell, SurfaceClass.BUILDING))
    for turn in (0.0, math.pi):
        for index in range(rooms):
            pose = upright_pose(np.zeros(3), turn) @ upright_pose(
                np.array([room * (index + 0.5) - half, side, 0.0]), 0.0
            )
            dealer.builder.add(_cell(room, depth, height).moved(pose))
            _furnish(dealer, turn, (room * (index + 0.5) - half, side), room, depth)
    places = lane(1.5 - half, half - 1.5)
    return dealer.finished("office_floor", places, 1.2, shifted(x=room))


def _cell(room: float, depth: float, height: float) -> Surfaces:
    """Return the walls of one room: from the corridor at y = 0 to the windows at y = depth."""
    x = 0.5 * room
    left, right = _DOOR[0] - x, _DOOR[0] + _DOOR[1] - x
    walls = blocks(
        [
            (-x, left, -_WALL, _WALL, -0.1, height),
            (right, x, -_WALL, _WALL, -0.1, height),
            (left, right, -_WALL, _WALL, _DOOR[2], height),
            (-x - _WALL, _WALL - x, 0.0, depth, -0.1, height),
            (x - _WALL, x + _WALL, 0.0, depth, -0.1, height),
            (-x, x, depth, depth + 0.3, -0.1, 0.9),
            (-x, x, depth, depth + 0.3, 2.3, height),
            (-x, 0.3 - x, depth, depth + 0.3, 0.9, 2.3),
            (x - 0.3, x, depth, depth + 0.3, 0.9, 2.3),
        ],
        SurfaceClass.BUILDING,
    )
    glass = blocks(
        [(0.3 - x, x - 0.3, depth + 0.1, depth + 0.12, 0.9, 2.3)], SurfaceClass.BUILDING, loss=0.7
    )
    return Surfaces.joined([walls, glass])


def _door(rng: np.random.Generator) -> Surfaces:
    """Return a door, closed in two of five cases, with its hinge at the origin."""
    leaf = blocks([(0.0, _DOOR[1], -0.02, 0.02, 0.0, _DOOR[2])], SurfaceClass.FENCE)
    angle = 0.0 if rng.random() < 0.4 else rng.uniform(0.6, 2.2)
    return leaf.moved(upright_pose(np.zeros(3), angle))


def _furnish(
    dealer: ThingDealer, turn: float, corner: tuple[float, float], room: float, depth: float
) -> None:
    """Deal the things of one room, and those in front of it in the corridor."""
    frame = upright_pose(np.zeros(3), turn)

    def at(x: float, y: float) -> list[float]:
        place: list[float] = frame.apply(np.array([corner[0] + x, corner[1] + y, 0.0])).tolist()
        return place

    x = 0.5 * room
    dealer.deal(at(_DOOR[0] - x, 0.0), [_door], chance=0.95, yaw=turn, turn=0.0)
    for side in (-1.0, 1.0):
        yaw = turn + 0.5 * math.pi
        place = at(side * (x - 0.6), depth - 1.1)
        dealer.deal(place, [table], chance=0.8, yaw=yaw, shift=(0.2, 0.1), turn=0.05)
        place = at(side * (x - 1.35), depth - 1.2)
        dealer.deal(place, [chair], chance=0.8, shift=(0.3, 0.1))
        place = at(side * (x - _WALL), depth - 3.0)
        dealer.deal(
            place, [shelf], chance=0.6, yaw=yaw - (1.0 + side) * 0.5 * math.pi, shift=(0.3, 0.0),
            turn=0.0,
        )  # fmt: skip
    makes = [crate, planter, trolley, chair, traffic.person]
    dealer.deal(at(0.3, depth - 2.2), makes, chance=0.5, shift=(0.3, 0.3))
    # Against the wall of the corridor, beside the door.
    dealer.deal(at(0.25 * room, -0.3), makes, chance=0.25, yaw=turn, shift=(0.4, 0.0), turn=0.1)
