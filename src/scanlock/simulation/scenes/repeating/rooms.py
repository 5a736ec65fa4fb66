"""Furnished rooms, and stairwells whose storeys are equal."""

import math

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.movables import (
    bicycle,
    chair,
    crate,
    planter,
    shelf,
    sofa,
    table,
    trolley,
)
from scanlock.simulation.objects.shapes import blocks, cones
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
)
from scanlock.simulation.scenes.repeating.visit import Visit

_STEPS = 9
"""Number of steps of a flight."""


def furnished_room(
    visit: Visit,
    *,
    length: float = 7.0,
    width: float = 5.4,
    height: float = 2.6,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a room with a door, a window and a bay, and furniture along its walls.

    Door, window and bay have places that depend on the seed. All furniture is loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several rooms with the same plan.
    length, width, height : float [m]
        Size of the room; at least 3 x 3 m.
    things : float
        Factor on the number of loose things.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    for name, value in (("length", length), ("width", width), ("height", height)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    x, y = 0.5 * length, 0.5 * width
    _build_room(dealer, visit.structure_rng(), x, y, height)
    makes = [shelf, shelf, sofa, table, planter, crate, chair]
    for yaw, along, out in (
        (0.0, x, y), (math.pi, x, y), (0.5 * math.pi, y, x), (-0.5 * math.pi, y, x),
    ):  # fmt: skip
        # Backs of shelves and sofas are to the wall.
        away = np.array([-math.sin(yaw), math.cos(yaw)])
        ahead = np.array([math.cos(yaw), math.sin(yaw)])
        count = int((2.0 * along - 1.4) // 1.3)
        for index in range(count):
            place = (out - 0.5) * away + 1.3 * (index - 0.5 * (count - 1)) * ahead
            dealer.deal(
                (*place.tolist(), 0.0), makes, chance=0.6, yaw=yaw, shift=(0.1, 0.05), turn=0.05
            )
    dealer.deal((0.0, 0.14 * width, 0.0), [table], chance=0.9, shift=(0.8, 0.1), turn=0.3)
    for at in (-0.7, 0.0, 0.7):
        dealer.deal((at, 0.02 * width, 0.0), [chair], chance=0.6, shift=(0.3, 0.1))
        dealer.deal((at, 0.28 * width, 0.0), [chair], chance=0.6, shift=(0.3, 0.1))
    places = lane(1.4 - x, x - 1.3, -0.18 * width)
    return dealer.finished("furnished_room", places, 1.2, None)


def _build_room(
    dealer: ThingDealer, rng: np.random.Generator, x: float, y: float, height: float
) -> None:
    """Add walls, ceiling, beam, door and window of a room."""
    door = rng.uniform(-0.7, 0.7) * (x - 0.6)
    window = rng.uniform(-0.4, 0.4) * y
    glazed = 0.45 * y
    bay = rng.uniform(-0.5, 0.5) * x
    out = rng.uniform(0.3, 0.6)
    walls = [
        (-x, x, -y, y, height, height + 0.2),
        (-x, x, y, y + 0.2, -0.1, height),
        (-x - 0.2, -x, -y, y, -0.1, height),
        (-x, door - 0.45, -y - 0.2, -y, -0.1, height),
        (door + 0.45, x, -y - 0.2, -y, -0.1, height),
        (door - 0.45, door + 0.45, -y - 0.2, -y, 2.05, height),
        (-x, x, -y - 2.0, -y - 1.8, -0.1, height),
        (-x - 0.2, -x, -y - 2.0, -y, -0.1, height),
        (x, x + 0.2, -y - 2.0, -y, -0.1, height),
        (x, x + 0.2, -y, window - glazed, -0.1, height),
        (x, x + 0.2, window + glazed, y, -0.1, height),
        (x, x + 0.2, window - glazed, window + glazed, -0.1, 0.9),
        (x, x + 0.2, window - glazed, window + glazed, 2.2, height),
        (bay - 0.3, bay + 0.3, y - out, y, -0.1, height),
        (-x, x, 0.1 * y, 0.1 * y + 0.2, height - 0.25, height),
    ]
    dealer.builder.add(blocks(walls, SurfaceClass.BUILDING))
    pane = (x + 0.1, x + 0.12, window - glazed, window + glazed, 0.9, 2.2)
    dealer.builder.add(blocks([pane], SurfaceClass.BUILDING, loss=0.7))


def stairwell(
    visit: Visit,
    *,
    storeys: int = 5,
    storey: float = 3.0,
    landing: float = 1.5,
    flight: float = 1.3,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a stairwell with two flights and two landings in each storey.

    Boxes, plants, bicycles, trolleys and people on the landings are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal stairwells.
    storeys : int
        Number of storeys.
    storey, landing, flight : float [m]
        Height of a storey, depth of the landings, and width of the flights.
    things : float
        Factor on the number of loose things.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    require_count("storeys", storeys)
    for name, value in (("storey", storey), ("landing", landing), ("flight", flight)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    x, y = 0.145 * _STEPS + landing, flight + 0.1
    for index in range(storeys):
        _build_storey(dealer, storey * index, storey, (x, y), landing, flight)
    top = storey * storeys
    shell = [
        (x, x + 0.2, -y, y, -0.1, top),
        (-x, x, -y - 0.2, -y, -0.1, top),
        (-x, x, y, y + 0.2, -0.1, top),
        (-x, x, -y, y, top, top + 0.2),
    ]
    dealer.builder.add(blocks(shell, SurfaceClass.BUILDING))
    makes = [crate, planter, bicycle, trolley, traffic.person]
    places: list[list[float]] = []
    for index in range(2 * storeys - 1):
        side = -1.0 if index % 2 == 0 else 1.0
        z = 0.5 * storey * index
        for across in (-0.7, 0.7):
            dealer.deal((side * (x - 0.35), across * y, z), makes, chance=0.4, turn=0.2)
        places += [[side * (x - 0.6 * landing), 0.25 * y * sign, z] for sign in (-1.0, 1.0)]
    return dealer.finished("stairwell", np.array(places), 1.2, shifted(z=storey))


def _build_storey(
    dealer: ThingDealer,
    z: float,
    storey: float,
    half: tuple[float, float],
    landing: float,
    flight: float,
) -> None:
    """Add the landings, flights, railings and door wall of one storey, from height z on."""
    x, y = half
    rise, tread = 0.5 * storey / _STEPS, 0.29
    middle = z + 0.5 * storey
    spans = [
        (-x, landing - x, -y, y, z - 0.2, z),
        (x - landing, x, -y, y, middle - 0.2, middle),
        # The wall of the entrance, at the lower landing.
        (-x - 0.2, -x, -y, -0.5, z, z + storey),
        (-x - 0.2, -x, 0.5, y, z, z + storey),
        (-x - 0.2, -x, -0.5, 0.5, z + 2.05, z + storey),
        (-x - 1.6, -x - 1.4, -0.7, 0.7, z, z + storey),
        (-x - 1.4, -x - 0.2, -0.7, -0.6, z, z + storey),
        (-x - 1.4, -x - 0.2, 0.6, 0.7, z, z + storey),
    ]
    foot = landing - x
    for step in range(_STEPS):
        up, back = z + rise * (step + 1), middle + rise * (step + 1)
        near = foot + tread * step
        spans.append((near, near + tread, -y, flight - y, up - rise - 0.12, up))
        spans.append((-near - tread, -near, y - flight, y, back - rise - 0.12, back))
    dealer.builder.add(blocks(spans, SurfaceClass.BUILDING))
    inner = y - flight
    feet = [[foot, -inner, z + 1.0], [-foot, inner, middle + 1.0]]
    heads = [[-foot, -inner, middle + 1.0], [foot, inner, z + storey + 1.0]]
    dealer.builder.add(cones(feet, heads, 0.03, 0.03, SurfaceClass.FENCE))
