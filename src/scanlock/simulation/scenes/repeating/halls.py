"""Halls and yards with equal rows: racks of a warehouse, stacks of containers."""

import math

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.furniture import street_lamp
from scanlock.simulation.objects.movables import (
    container,
    crate,
    forklift,
    pallet,
    rack_load,
    traffic_cone,
    trolley,
)
from scanlock.simulation.objects.shapes import blocks
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
    stations,
)
from scanlock.simulation.scenes.repeating.visit import Visit
from scanlock.simulation.scenes.site import upright_pose

_RACK = 1.1
"""Depth of a rack [m]; two are back to back."""

_LEVELS = (0.15, 1.7, 3.25, 4.8)
"""Heights of the beams of a rack [m]."""

_FRONT = 14.0
"""Length of the free zone in front of the racks [m]."""

_CONTAINER = (6.06, 2.44)
"""Length and width of a container [m]."""


def warehouse(
    visit: Visit,
    *,
    racks: int = 5,
    bays: int = 14,
    bay: float = 2.7,
    aisle: float = 3.4,
    height: float = 8.0,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a hall of a warehouse, whose racks repeat every bay.

    Double racks stand along x between aisles, with a zone for goods in front of them. The loads of
    the racks, pallets, trolleys, forklifts and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is the hall.
    racks, bays : int
        Number of double racks, and of bays of each.
    bay, aisle, height : float [m]
        Length of a bay, width of an aisle, and height of the hall.
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
    require_count("racks", racks)
    require_count("bays", bays)
    for name, value in (("bay", bay), ("aisle", aisle), ("height", height)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    pitch = 2.0 * _RACK + aisle
    rows = [pitch * (index - 0.5 * (racks - 1)) for index in range(racks)]
    half = 0.5 * bays * bay
    width = rows[-1] + 0.5 * pitch + 1.0
    _build_hall(dealer, half, width, height)
    for y in rows:
        _build_rack(dealer, y, bays, bay)
    _fill_racks(dealer, rows, bays, bay)
    for column in range(8):
        for row in range(max(2, round(2.0 * width / 3.0))):
            at = (half + 4.0 + 1.4 * column, 1.5 + 3.0 * row - width, 0.0)
            if abs(at[0] - half - 2.5) > 1.4:
                makes = [pallet, pallet, pallet, crate, trolley, forklift, traffic.person]
                dealer.deal(at, makes, chance=0.35, shift=(0.3, 0.7))
    for y in rows[:-1]:
        for index in range(bays):
            side = 1.0 if index % 2 else -1.0
            at = (bay * (index + 0.5) - half, y + 0.5 * pitch + side * 0.33 * aisle, 0.0)
            dealer.deal(at, [pallet, crate, trolley, traffic.person], chance=0.15, turn=0.4)
    middle = rows[(racks - 1) // 2] + 0.5 * pitch
    return dealer.finished(
        "warehouse", lane(1.0 - half, half + 2.0, middle), 1.2, shifted(x=bay)
    )  # fmt: skip


def _build_hall(dealer: ThingDealer, half: float, width: float, height: float) -> None:
    low, high = -half - 3.0, half + _FRONT
    spans = [
        (low - 0.2, low, -width, width, -0.1, height),
        (high, high + 0.2, -width, width, -0.1, height),
        (low, high, -width - 0.2, -width, -0.1, height),
        (low, high, width, width + 0.2, -0.1, height),
        (low, high, -width, width, height, height + 0.2),
    ]
    for index in range(int((high - low) // 6.0)):
        x = high - 3.0 - 6.0 * index
        spans += [(x - 0.15, x + 0.15, -width, width, height - 0.5, height)]
        for side in (-width, width):
            spans += [(x - 0.15, x + 0.15, side - 0.3, side + 0.3, -0.1, height)]
    dealer.builder.add(blocks(spans, SurfaceClass.BUILDING))


def _build_rack(dealer: ThingDealer, y: float, bays: int, bay: float) -> None:
    half, out = 0.5 * bays * bay, _RACK
    spans = []
    for index in range(bays + 1):
        x = bay * index - half
        for at in (y - out, y - 0.1, y + 0.1, y + out):
            spans.append((x - 0.05, x + 0.05, at - 0.05, at + 0.05, -0.1, 6.4))
    for level in _LEVELS:
        for at in (y - out, y - 0.1, y + 0.1, y + out):
            spans.append((-half, half, at - 0.03, at + 0.03, level - 0.12, level))
    dealer.builder.add(blocks(spans, SurfaceClass.FENCE))


def _fill_racks(dealer: ThingDealer, rows: list[float], bays: int, bay: float) -> None:
    half = 0.5 * bays * bay
    for y in rows:
        for side in (-0.5, 0.5):
            for index in range(2 * bays):
                for level in _LEVELS:
                    at = (0.5 * bay * (index + 0.5) - half, y + side * 1.15 * _RACK, level)
                    dealer.deal(at, [rack_load], chance=0.75, turn=0.03, shift=(0.05, 0.05))


def container_yard(
    visit: Visit,
    *,
    rows: int = 6,
    row: int = 10,
    aisle: float = 8.0,
    places_per_lamp: int = 4,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a yard with double rows of places for containers along x.

    Lamp posts stand beside the aisles. The stacks, of none to three containers, as well as
    vehicles, pallets, cones and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is the field of the yard.
    rows, row : int
        Number of double rows, and of places along each.
    aisle : float [m]
        Width of the aisles between the rows.
    places_per_lamp : int
        Number of places from one lamp post to the next.
    things : float
        Factor on the number of loose things, of at most 1 for containers.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    require_count("rows", rows)
    require_count("row", row)
    require_positive("aisle", aisle, unit="m")
    require_count("places_per_lamp", places_per_lamp)
    dealer = ThingDealer(visit, things)
    step, pitch = _CONTAINER[0] + 0.4, 2.0 * _CONTAINER[1] + 0.3 + aisle
    post = street_lamp(visit.structure_rng())
    for index in range(rows):
        y = pitch * (index - 0.5 * (rows - 1))
        for place in range(row):
            for side in (-0.5, 0.5):
                at = (step * (place + 0.5 - 0.5 * row), y + side * (_CONTAINER[1] + 0.3), 0.0)
                dealer.deal(at, [container], chance=0.75, turn=0.01, shift=(0.1, 0.05))
            makes = [pallet, traffic.person, traffic_cone, forklift, traffic.car]
            at = (step * (place + 0.5 - 0.5 * row), y + 0.5 * pitch - 0.35 * aisle, 0.0)
            dealer.deal(at, makes, chance=0.25, shift=(2.0, 0.2), turn=0.3)
        for x in stations(step * places_per_lamp, 0.5 * step * row):
            foot = np.array([x, y + 0.5 * pitch + 0.42 * aisle, 0.0])
            dealer.builder.add(post, upright_pose(foot, math.pi))
    half = 0.5 * step * row
    places = lane(1.0 - half, half - 1.0, 0.0 if rows % 2 == 0 else 0.5 * pitch)
    return dealer.finished("container_yard", places, 1.8, shifted(x=step * places_per_lamp))
