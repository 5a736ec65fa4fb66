"""Tunnels of equal rings, with niches."""

import math

import numpy as np

from scanlock.arrays import Matrix
from scanlock.errors import require_count, require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.movables import crate, pallet, traffic_cone, trolley
from scanlock.simulation.objects.shapes import blocks, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
)
from scanlock.simulation.scenes.repeating.visit import Visit

_SIDES = 36
_AXIS = 1.6
"""Height of the axis above the roadway [m]."""

_NICHE = 2.2
"""Height of a niche [m]."""


def ringed_tunnel(
    visit: Visit,
    *,
    ring: float = 3.0,
    rings_per_niche: int = 5,
    radius: float = 4.5,
    length: float = 150.0,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a tunnel along x with a rib at every ring and a niche every few rings.

    Ribs of 0.12 m stand out from the wall; niches are one ring long, 2.2 m high and at one side.
    Cars, cones, boxes, trolleys and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal tubes.
    ring : float [m]
        Length of a ring.
    rings_per_niche : int
        Number of rings from one niche to the next.
    radius, length : float [m]
        Radius and length of the tunnel.
    things : float
        Factor on the number of loose things.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive, or a radius of less than 2 m.
    """
    for name, value in (("ring", ring), ("radius", radius), ("length", length)):
        require_positive(name, value, unit="m")
    require_count("rings_per_niche", rings_per_niche)
    dealer = ThingDealer(visit, things)
    count = max(1, round(0.5 * length / ring))
    for index in range(-count, count):
        x = ring * index
        has_niche = index % rings_per_niche == 0
        dealer.builder.add(triangles(_ring(x, ring, radius, has_niche), SurfaceClass.BUILDING))
        dealer.builder.add(triangles(_rib(x, radius), SurfaceClass.BUILDING))
        if has_niche:
            wall = _wall(radius)
            dealer.builder.add(
                blocks(
                    [
                        (x, x + ring, wall + 1.2, wall + 1.4, -0.1, _NICHE),
                        (x - 0.1, x, wall - 0.1, wall + 1.4, -0.1, _NICHE),
                        (x + ring, x + ring + 0.1, wall - 0.1, wall + 1.4, -0.1, _NICHE),
                        (x, x + ring, wall - 1.0, wall + 1.4, _NICHE, _NICHE + 0.2),
                    ],
                    SurfaceClass.BUILDING,
                )
            )
        _deal_ring(dealer, x + 0.5 * ring, radius)
    half = 0.3 * length
    return dealer.finished(
        "ringed_tunnel", lane(-half, half), 1.6, shifted(x=ring * rings_per_niche)
    )


def _deal_ring(dealer: ThingDealer, x: float, radius: float) -> None:
    kerb = _wall(radius) - 0.7
    makes = [traffic_cone, crate, pallet, trolley, traffic.person]
    for side in (-1.0, 1.0):
        dealer.deal((x, side * kerb, 0.0), makes, chance=0.2, shift=(1.0, 0.1), turn=0.3)


def _wall(radius: float) -> float:
    """Return the distance of the wall from the middle at the height of the roadway [m]."""
    return math.sqrt(max(radius**2 - _AXIS**2, 0.25))


def _profile(radius: float) -> Matrix:
    """Return the corners (y, z) of a cross section above the roadway, from right to left [m]."""
    low = -math.asin(min(_AXIS / radius, 0.99))
    angles = np.linspace(low, math.pi - low, _SIDES + 1)
    return np.column_stack([-radius * np.cos(angles), _AXIS + radius * np.sin(angles)])


def _strip(near: Matrix, far: Matrix) -> np.ndarray:
    """Return the triangles between two rows of (n, 3) corners."""
    return np.concatenate(
        [
            np.stack([near[:-1], near[1:], far[1:]], axis=1),
            np.stack([near[:-1], far[1:], far[:-1]], axis=1),
        ]
    )


def _ring(x: float, ring: float, radius: float, has_niche: bool) -> np.ndarray:
    """Return the wall of one ring; without its panels at the left below the top of a niche."""
    corners = _profile(radius)
    if has_niche:
        is_niche = (corners[:, 0] > 0.0) & (corners[:, 1] < _NICHE)
        corners = corners[~is_niche]
    near, far = (np.column_stack([np.full(len(corners), at), corners]) for at in (x, x + ring))
    return _strip(near, far)


def _rib(x: float, radius: float) -> np.ndarray:
    """Return a rib across the wall at x, 0.12 m deep and 0.3 m long."""
    inner, outer = _profile(radius - 0.12), _profile(radius)
    sections = ((x - 0.15, outer), (x - 0.15, inner), (x + 0.15, inner), (x + 0.15, outer))
    lines = [np.column_stack([np.full(len(corners), at), corners]) for at, corners in sections]
    return np.concatenate([_strip(*lines[i : i + 2]) for i in range(3)])
