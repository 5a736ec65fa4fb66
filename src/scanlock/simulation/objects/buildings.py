"""Houses with uneven fronts: set-back sections, recessed windows, bays, porches and roofs.

The front of a house is along x in the plane y = 0 and faces -y; z = 0 is the ground.
"""

import itertools

import numpy as np
from numpy.typing import NDArray

from scanlock.simulation.objects.shapes import blocks, cones, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_FOOT = 1.5
"""Depth of walls below the ground [m], for slopes."""

_GLASS = 0.5
"""Ratio of pulses that a window does not return."""

_Span = tuple[float, float, float, float, float, float]
"""Low and high x, low and high y, low and high z of an axis-aligned block [m]."""


def house(
    rng: np.random.Generator, *, width: float, depth: float, storeys: int, forecourt: float
) -> Surfaces:
    """Generate a house of one to three sections, each with its own set-back, height and roof.

    Parameters
    ----------
    rng : Generator
    width, depth : float [m]
    storeys : int
    forecourt : float [m]
        Maximum extent of bays and porch in front of the house.
    """
    sections = 1 + int(rng.integers(0, 3)) if width > 9.0 else 1
    edges = np.linspace(-0.5 * width, 0.5 * width, sections + 1)
    edges[1:-1] += rng.uniform(-0.15, 0.15, sections - 1) * width / sections
    parts: list[Surfaces] = []
    for left, right in itertools.pairwise(edges):
        back = rng.uniform(0.0, 1.8) if sections > 1 else 0.0
        floors = max(1, storeys - int(rng.random() < 0.25))
        parts.append(_section(rng, left, right, back, depth, floors, forecourt + back))
    if rng.random() < 0.7 and forecourt > 1.0:
        parts.append(_porch(rng, width, forecourt))
    if rng.random() < 0.35 and storeys > 1:
        parts.append(_balcony(rng, width))
    for side in (-1.0, 1.0):
        if rng.random() < 0.5:
            x = side * (0.5 * width - rng.uniform(0.1, 0.3))
            parts.append(
                cones([[x, -0.08, -_FOOT]], [[x, -0.08, 2.8 * storeys]], 0.05, 0.05,
                      SurfaceClass.BUILDING)
            )  # fmt: skip
    if rng.random() < 0.5:
        parts.append(_side_wing(rng, width, depth))
    return Surfaces.joined(parts)


def shed(rng: np.random.Generator, *, width: float, depth: float) -> Surfaces:
    """Generate a plain block with a roof, as a garage or a shed."""
    height = rng.uniform(2.2, 3.2)
    walls = _blocks([(-0.5 * width, 0.5 * width, 0.0, depth, -_FOOT, height)])
    return Surfaces.joined([walls, _roof(rng, -0.5 * width, 0.5 * width, 0.0, depth, height)])


def _section(
    rng: np.random.Generator,
    left: float,
    right: float,
    back: float,
    depth: float,
    floors: int,
    room: float,
) -> Surfaces:
    """Return one section: a body, a front with recessed windows, an optional bay, and a roof."""
    storey = rng.uniform(2.6, 3.1)
    plinth = rng.uniform(0.1, 0.8)
    height = plinth + floors * storey
    recess = rng.uniform(0.1, 0.28)
    body = _blocks([(left, right, back + recess, depth, -_FOOT, height)])
    front = _front(rng, left, right, back, recess, plinth, storey, floors)
    parts = [body, front]
    if right - left > 4.0 and room > 0.4 and rng.random() < 0.5:
        half = rng.uniform(0.9, 1.5)
        middle = rng.uniform(left + half, right - half)
        top = plinth + storey * (1 + int(rng.integers(0, floors)))
        out = rng.uniform(0.3, min(0.9, room))
        parts.append(_blocks([(middle - half, middle + half, back - out, back + 0.5, -_FOOT, top)]))
    parts.append(_roof(rng, left, right, back, depth, height))
    return Surfaces.joined(parts)


def _front(
    rng: np.random.Generator,
    left: float,
    right: float,
    back: float,
    recess: float,
    plinth: float,
    storey: float,
    floors: int,
) -> Surfaces:
    """Return the surface of a front: piers and bands of wall, with recessed glass between them."""
    columns = max(1, round((right - left) / rng.uniform(2.3, 3.8)))
    edges = np.linspace(left, right, columns + 1)
    edges[1:-1] += rng.uniform(-0.3, 0.3, columns - 1)
    walls: list[_Span] = []
    glass: list[_Span] = []
    inner = back + recess
    top = plinth + floors * storey
    for low, high in itertools.pairwise(edges):
        half = min(rng.uniform(0.45, 0.9), 0.5 * (high - low) - 0.15)
        middle = 0.5 * (low + high) + rng.uniform(-0.1, 0.1)
        walls.append((low, middle - half, back, inner, -_FOOT, top))
        walls.append((middle + half, high, back, inner, -_FOOT, top))
        band = -_FOOT
        for floor in range(floors):
            sill = plinth + floor * storey + rng.uniform(0.6, 1.0)
            if floor == 0 and rng.random() < 0.2:
                sill = 0.1
            head = plinth + floor * storey + rng.uniform(2.1, 2.4)
            walls.append((middle - half, middle + half, back, inner, band, sill))
            glass.append((middle - half, middle + half, inner - 0.03, inner - 0.01, sill, head))
            band = head
        walls.append((middle - half, middle + half, back, inner, band, top))
    return Surfaces.joined([_blocks(walls), _blocks(glass, loss=_GLASS)])


def _roof(
    rng: np.random.Generator, left: float, right: float, front: float, back: float, eaves: float
) -> Surfaces:
    """Return a gable along or across the front, or a flat roof with a parapet."""
    style = rng.choice(["along", "across", "flat"], p=[0.5, 0.25, 0.25])
    if style == "flat":
        rim = rng.uniform(0.2, 0.7)
        return _blocks(
            [
                (left, right, front, front + 0.2, eaves, eaves + rim),
                (left, right, back - 0.2, back, eaves, eaves + rim),
                (left, left + 0.2, front, back, eaves, eaves + rim),
                (right - 0.2, right, front, back, eaves, eaves + rim),
            ]
        )
    pitch, out = rng.uniform(0.5, 0.95), rng.uniform(0.2, 0.5)
    if style == "along":
        corners, ridge = _gable((left, right), (front, back), eaves, pitch, out)
    else:
        corners, ridge = _gable((front, back), (left, right), eaves, pitch, out)
        corners = corners[:, :, [1, 0, 2]]
    roof = triangles(corners, SurfaceClass.BUILDING)
    x, y = rng.uniform(left + 0.6, right - 0.6), rng.uniform(0.4, 0.6) * (front + back)
    chimney = _blocks([(x - 0.35, x + 0.35, y - 0.3, y + 0.3, eaves, ridge + 0.8)])
    return Surfaces.joined([roof, chimney])


def _gable(
    ends: tuple[float, float],
    sides: tuple[float, float],
    eaves: float,
    pitch: float,
    out: float,
) -> tuple[NDArray[np.float64], float]:
    """Return the (6, 3, 3) triangles of a gable roof with its ridge along x, and its height [m].

    `pitch` is the slope of the roof, and `out` its overhang beyond the sides [m].
    """
    middle = 0.5 * (sides[0] + sides[1])
    ridge = eaves + pitch * (sides[1] - middle)
    tops = [(end, middle, ridge) for end in ends]
    corners: list[list[tuple[float, float, float]]] = []
    for side, beyond in zip(sides, (-out, out), strict=True):
        feet = [(end, side + beyond, eaves - pitch * out) for end in ends]
        corners += [[feet[0], feet[1], tops[1]], [feet[0], tops[1], tops[0]]]
    corners += [
        [(end, sides[0], eaves), (end, sides[1], eaves), top]
        for end, top in zip(ends, tops, strict=True)
    ]
    return np.array(corners), ridge


def _porch(rng: np.random.Generator, width: float, room: float) -> Surfaces:
    """Return a porch: a step, a slab, and posts below a small roof."""
    middle = rng.uniform(-0.3, 0.3) * width
    half = rng.uniform(0.8, 1.6)
    out = rng.uniform(0.6, min(1.7, room - 0.35))
    top = rng.uniform(2.3, 2.7)
    slabs = _blocks(
        [
            (middle - half, middle + half, -out, 0.2, top, top + 0.15),
            (middle - half, middle + half, -out, 0.2, -_FOOT, 0.3),
            (middle - 0.6, middle + 0.6, -out - 0.35, -out, -_FOOT, 0.15),
        ]
    )
    x = np.array([middle - half + 0.1, middle + half - 0.1])
    feet = np.column_stack([x, np.full(2, 0.1 - out), np.full(2, 0.3)])
    posts = cones(feet, feet + np.array([0.0, 0.0, top - 0.3]), 0.07, 0.07, SurfaceClass.BUILDING)
    return Surfaces.joined([slabs, posts])


def _balcony(rng: np.random.Generator, width: float) -> Surfaces:
    """Return a balcony on the first floor with a barred railing."""
    middle = rng.uniform(-0.3, 0.3) * width
    half, out, floor = rng.uniform(1.0, 2.0), rng.uniform(0.8, 1.3), rng.uniform(2.9, 3.3)
    slab = _blocks(
        [
            (middle - half, middle + half, -out, 0.1, floor - 0.15, floor),
            (middle - half, middle + half, -out, 0.04 - out, floor + 0.95, floor + 1.0),
        ]
    )
    x = np.arange(middle - half, middle + half, 0.14)
    feet = np.column_stack([x, np.full(len(x), 0.02 - out), np.full(len(x), floor)])
    bars = cones(feet, feet + np.array([0.0, 0.0, 0.97]), 0.012, 0.012, SurfaceClass.BUILDING)
    return Surfaces.joined([slab, bars])


def _side_wing(rng: np.random.Generator, width: float, depth: float) -> Surfaces:
    """Return a low annexe behind the front, within the plot of the house."""
    side = float(rng.choice([-1.0, 1.0]))
    out = rng.uniform(0.2, 0.6)
    low, high = rng.uniform(0.2, 0.5) * depth, rng.uniform(0.7, 1.0) * depth
    x = np.sort([side * (0.5 * width + out), side * 0.3 * width])
    return _blocks([(x[0], x[1], low, high, -_FOOT, rng.uniform(2.4, 3.4))])


def _blocks(spans: list[_Span], loss: float = 0.0) -> Surfaces:
    return blocks(spans, SurfaceClass.BUILDING, loss=loss)
