"""Random sizes of the worlds that repeat, by name."""

from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks._common.contenders import MAX_DEGREES, MAX_METRES

_Draw = Callable[[np.random.Generator], dict[str, Any]]

_ROOM_TOLERANCE = (0.3, 1.5)
_ROOMS = ("office_floor", "furnished_room", "stairwell")

_SIZES: dict[str, _Draw] = {
    "car_park": lambda r: {
        "bays": 3 * int(r.integers(5, 11)), "bay": r.uniform(2.3, 2.7),
        "aisle": r.uniform(5.5, 7.0), "aisles": int(r.integers(1, 4)),
        "height": r.uniform(2.4, 3.4), "occupancy": r.uniform(0.3, 0.95),
    },
    "warehouse": lambda r: {
        "racks": int(r.integers(3, 7)), "bays": int(r.integers(8, 20)),
        "bay": r.uniform(2.4, 3.3), "aisle": r.uniform(2.8, 4.5), "height": r.uniform(7.0, 10.0),
    },
    "colonnade": lambda r: {
        "spacing": r.uniform(3.0, 6.0), "width": r.uniform(3.5, 7.0), "height": r.uniform(3.5, 6.0),
        "radius": r.uniform(0.2, 0.5), "length": r.uniform(60.0, 200.0),
    },
    "avenue": lambda r: {
        "spacing": r.uniform(6.0, 12.0), "road": r.uniform(6.0, 11.0), "variety": r.uniform(),
    },
    "orchard": lambda r: {
        "spacing": r.uniform(2.5, 5.0), "row": r.uniform(3.5, 6.0), "variety": r.uniform(),
        "length": r.uniform(60.0, 120.0), "rows": int(r.integers(8, 16)),
    },
    "vineyard": lambda r: {
        "spacing": r.uniform(4.0, 7.0), "row": r.uniform(2.0, 3.2),
        "length": r.uniform(50.0, 120.0), "rows": int(r.integers(10, 20)),
        "variety": r.uniform(),
    },
    "ringed_tunnel": lambda r: {
        "ring": r.uniform(1.5, 5.0), "rings_per_niche": int(r.integers(2, 9)),
        "radius": r.uniform(3.0, 6.0), "length": r.uniform(80.0, 300.0),
    },
    "terraced_street": lambda r: {
        "width": r.uniform(5.0, 9.0), "road": r.uniform(6.0, 11.0),
        "houses": int(r.integers(15, 40)),
    },
    "crossroads": lambda r: {"width": r.uniform(5.0, 9.0), "road": r.uniform(6.0, 11.0)},
    "office_floor": lambda r: {
        "rooms": int(r.integers(5, 16)), "room": r.uniform(2.8, 5.0), "depth": r.uniform(4.0, 6.0),
        "corridor": r.uniform(1.7, 2.8),
    },
    "furnished_room": lambda r: {
        "length": r.uniform(5.5, 10.0), "width": r.uniform(5.0, 7.0), "height": r.uniform(2.4, 3.4),
    },
    "stairwell": lambda r: {
        "storeys": int(r.integers(3, 8)), "storey": r.uniform(2.7, 3.6),
        "landing": r.uniform(1.3, 2.0), "flight": r.uniform(1.1, 1.6),
    },
    "platform": lambda r: {
        "spacing": r.uniform(4.5, 10.0), "width": r.uniform(5.0, 11.0),
        "length": r.uniform(120.0, 280.0),
    },
    "container_yard": lambda r: {
        "rows": int(r.integers(3, 8)), "row": int(r.integers(6, 14)), "aisle": r.uniform(6.0, 14.0),
        "places_per_lamp": int(r.integers(2, 6)),
    },
}  # fmt: skip
"""Functions that draw the sizes of each world."""


def sizes_of(name: str, rng: np.random.Generator) -> dict[str, Any]:
    """Return random sizes of a world, as arguments of its function."""
    return _SIZES[name](rng)


def tolerance_in(name: str) -> tuple[float, float]:
    """Return the errors within which a pose in a world is correct [m, deg]."""
    return _ROOM_TOLERANCE if name in _ROOMS else (MAX_METRES, MAX_DEGREES)
