"""Worlds with ambiguous poses: scans from different poses are the same.

Each world is centred on the origin, has its floor at z = 0 and extends beyond the range of all
`SENSORS`, so that its ends are not visible from near the origin.
"""

import math

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects.shapes import boxes, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import World

_HALF_LENGTH = 300.0
"""Half length of worlds that represent endless ones [m]; sensors see up to 200 m."""


def open_field() -> World:
    """Return level ground only: x, y and yaw are unobservable."""
    return World.of((), _floor())


def corridor(width: float = 3.0, height: float = 2.6) -> World:
    """Return an endless corridor along x, with floor and ceiling: x is unobservable."""
    require_positive("width", width, unit="m")
    require_positive("height", height, unit="m")
    middles = [(0.0, 0.5 * width + 0.1), (0.0, -0.5 * width - 0.1)]
    walls = [((x, y, 0.5 * height), (_HALF_LENGTH, 0.1, 0.5 * height)) for x, y in middles]
    ceiling = ((0.0, 0.0, height + 0.1), (_HALF_LENGTH, 0.5 * width + 0.2, 0.1))
    return World.of(_boxes([*walls, ceiling]), _floor())


def tunnel(radius: float = 4.0, sides: int = 48) -> World:
    """Return an endless round tunnel along x, its axis at z = 0: x and roll are unobservable."""
    return World.of(_tube(radius, sides, axis=0))


def shaft(radius: float = 8.0, sides: int = 96) -> World:
    """Return a round room about z on level ground: yaw is unobservable."""
    return World.of(_tube(radius, sides, axis=2), _floor())


def crossing(street: float = 14.0, block: float = 30.0, height: float = 9.0) -> World:
    """Return a crossing of four equal streets: poses that differ by quarter turns are ambiguous."""
    for name, value in (("street", street), ("block", block), ("height", height)):
        require_positive(name, value, unit="m")
    middle = 0.5 * (street + block)
    centres = [(x, y) for x in (-middle, middle) for y in (-middle, middle)]
    size = (0.5 * block, 0.5 * block, 0.5 * height)
    return World.of(_boxes([((x, y, 0.5 * height), size) for x, y in centres]), _floor())


def terrace(spacing: float = 8.0, street: float = 12.0) -> World:
    """Return an endless street of equal houses along x: shifts by `spacing` [m] are ambiguous."""
    require_positive("spacing", spacing, unit="m")
    require_positive("street", street, unit="m")
    along = (
        np.arange(-math.floor(_HALF_LENGTH / spacing), math.floor(_HALF_LENGTH / spacing) + 1)
        * spacing
    )
    house = (0.35 * spacing, 4.0, 3.5)
    sides = (0.5 * street + house[1], -0.5 * street - house[1])
    return World.of(_boxes([((x, y, house[2]), house) for x in along for y in sides]), _floor())


def _floor() -> HeightField:
    return HeightField.level(_HALF_LENGTH)


def _boxes(parts: list[tuple[tuple[float, float, float], tuple[float, float, float]]]) -> Surfaces:
    centres, halves = (np.array(column) for column in zip(*parts, strict=True))
    return boxes(centres, halves, SurfaceClass.BUILDING)


def _tube(radius: float, sides: int, axis: int) -> Surfaces:
    """Return the walls of an endless prism about a coordinate axis."""
    require_positive("radius", radius, unit="m")
    require_count("sides", sides, minimum=3)
    angles = np.linspace(0.0, 2.0 * math.pi, sides + 1)
    ring = np.roll(
        np.column_stack([np.zeros(sides + 1), radius * np.cos(angles), radius * np.sin(angles)]),
        axis,
        axis=1,
    )
    away = np.zeros(3)
    away[axis] = _HALF_LENGTH
    near, far = ring - away, ring + away
    corners = np.concatenate(
        [
            np.stack([near[:-1], near[1:], far[1:]], axis=1),
            np.stack([near[:-1], far[1:], far[:-1]], axis=1),
        ]
    )
    return triangles(corners, SurfaceClass.BUILDING)
