"""Floors of a multi-storey car park: equal structure, other cars on each floor and visit."""

import math

from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.movables import crate, traffic_cone, trolley
from scanlock.simulation.objects.shapes import blocks
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
)
from scanlock.simulation.scenes.repeating.visit import Visit

_DEPTH = 5.0
"""Length of a bay [m]."""

_BAYS_PER_COLUMN = 3


def car_park(
    visit: Visit,
    *,
    bays: int = 24,
    bay: float = 2.5,
    aisle: float = 6.0,
    aisles: int = 2,
    height: float = 2.8,
    occupancy: float = 0.7,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate one floor of a car park, whose columns and beams repeat every three bays.

    The floor has aisles along x with bays on both sides, a parapet, closed ends, and a stair in one
    corner. Cars, people and trolleys are loose.

    Parameters
    ----------
    visit : Visit
        Its part is the floor.
    bays : int
        Number of bays on each side of an aisle; a multiple of three.
    bay, aisle : float [m]
        Width of a bay, and of an aisle.
    aisles : int
        Number of aisles.
    height : float [m]
        Height of the ceiling.
    occupancy : float
        Probability that a bay has a car.
    things : float
        Factor on the number of cars and other loose things.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    require_count("bays", bays)
    require_count("aisles", aisles)
    for name, value in (("bay", bay), ("aisle", aisle), ("height", height)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    module = aisle + 2.0 * _DEPTH
    half = (0.5 * bays * bay, 0.5 * aisles * module)
    middles = [module * (index - 0.5 * (aisles - 1)) for index in range(aisles)]
    _build(dealer, half, middles, bay * _BAYS_PER_COLUMN, aisle, height)
    for middle in middles:
        for side in (-1.0, 1.0):
            for index in range(bays):
                x = bay * (index + 0.5) - half[0]
                y = middle + side * 0.5 * (aisle + _DEPTH)
                dealer.deal(
                    (x, y, 0.0), [traffic.car], chance=occupancy, shift=(0.25, 0.2), turn=0.03,
                    yaw=side * 0.5 * math.pi,
                )  # fmt: skip
            for index in range(bays // _BAYS_PER_COLUMN):
                x = bay * _BAYS_PER_COLUMN * (index + 0.5) - half[0]
                dealer.deal(
                    (x, middle + side * (0.5 * aisle - 0.4), 0.0),
                    [traffic.person, traffic.person, trolley, traffic_cone, crate],
                    chance=0.3, shift=(3.0, 0.3),
                )  # fmt: skip
    period = shifted(x=bay * _BAYS_PER_COLUMN)
    return dealer.finished("car_park", lane(6.0 - half[0], half[0] - 6.0, middles[0]), 1.8, period)


def _build(
    dealer: ThingDealer,
    half: tuple[float, float],
    middles: list[float],
    spacing: float,
    aisle: float,
    height: float,
) -> None:
    """Add ceiling, beams, columns, parapets, ends and a stair."""
    x, y = half
    deep = height - 0.45
    spans = [
        (-x, x, -y, y, height, height + 0.3),
        (-x, x, -y - 0.2, -y, -0.1, 1.1),
        (-x, x, y, y + 0.2, -0.1, 1.1),
        (-x - 0.2, -x, -y - 0.2, y + 0.2, -0.1, height),
        (x, x + 0.2, -y - 0.2, y + 0.2, -0.1, height),
        (x - 4.5, x, y - 4.5, y, -0.1, height),
    ]
    lines = 1 + round(2.0 * x / spacing)
    for line in range(lines):
        at = spacing * line - x
        spans.append((at - 0.2, at + 0.2, -y, y, deep, height))
        for edge in {round(m + s * 0.5 * aisle + s * 0.7, 6) for m in middles for s in (-1, 1)}:
            spans.append((at - 0.2, at + 0.2, edge - 0.3, edge + 0.3, -0.1, deep))
        for side in (-y, y):
            spans.append((at - 0.15, at + 0.15, side - 0.2, side + 0.2, -0.1, deep))
    dealer.builder.add(blocks(sorted(spans), SurfaceClass.BUILDING))
