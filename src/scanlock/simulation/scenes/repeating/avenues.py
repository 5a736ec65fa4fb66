"""Rows of trees and posts: avenues, orchards and vineyards."""

import math

import numpy as np

from scanlock.errors import require_count, require_fraction, require_positive
from scanlock.simulation.objects import furniture, plants, traffic
from scanlock.simulation.objects.movables import bench, bicycle, crate, pallet, rubbish_bins
from scanlock.simulation.objects.shapes import blocks, cones, discs
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scenes.repeating.repeating_world import (
    RepeatingWorld,
    ThingDealer,
    lane,
    shifted,
    stations,
)
from scanlock.simulation.scenes.repeating.visit import Visit
from scanlock.simulation.scenes.site import upright_pose

_DETAIL_DISTANCE = 20.0
"""Distance from the middle beyond which trees have fewer and larger leaves [m]."""


def avenue(
    visit: Visit,
    *,
    spacing: float = 8.0,
    road: float = 7.0,
    length: float = 240.0,
    variety: float = 0.5,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a straight road along x between rows of trees and lamp posts.

    Trees and posts alternate every half `spacing` on both sides. Parked cars, bins, bicycles,
    benches and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal sections.
    spacing, road, length : float [m]
        Distance between trees, width of the road, and length of the avenue.
    variety : float
        Variation among the trees, from 0 for equal ones to 1 for those of a street.
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
    for name, value in (("spacing", spacing), ("road", road), ("length", length)):
        require_positive(name, value, unit="m")
    require_fraction("variety", variety)
    dealer = ThingDealer(visit, things)
    rng = visit.structure_rng()
    x, kerb = 0.5 * length, 0.5 * road
    out = kerb + 1.2
    lamp = furniture.street_lamp(rng)
    for side in (-1.0, 1.0):
        near, far = sorted((side * kerb, side * (kerb + 4.0)))
        dealer.builder.add(blocks([(-x, x, near, far, -0.2, 0.12)], SurfaceClass.GROUND))
        _plant_row(dealer, rng, stations(spacing, x), side * out, (9.0, 2.2, 0.16), variety)
        for at in stations(spacing, x):
            foot = np.array([at + 0.5 * spacing, side * out, 0.12])
            dealer.builder.add(lamp, upright_pose(foot, math.pi if side > 0 else 0.0))
    for at in stations(5.6, x):
        for side in (-1.0, 1.0):
            dealer.deal(
                (at, side * (kerb - 1.0), 0.0), [traffic.car], chance=0.45,
                yaw=math.pi if side > 0 else 0.0, shift=(0.3, 0.1), turn=0.03,
            )  # fmt: skip
            makes = [traffic.person, bench, bicycle, rubbish_bins]
            dealer.deal(
                (at, side * (kerb + 2.9), 0.12), makes, chance=0.35, shift=(2.0, 0.4)
            )  # fmt: skip
    return dealer.finished("avenue", lane(-0.25 * length, 0.25 * length), 1.8, shifted(x=spacing))


def orchard(
    visit: Visit,
    *,
    spacing: float = 3.0,
    row: float = 4.5,
    length: float = 90.0,
    rows: int = 12,
    variety: float = 0.3,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate an orchard on level ground: equal rows of small trees along x.

    Crates, pallets and people are loose, one every 30 m of a row.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal fields.
    spacing, row, length : float [m]
        Distance between trees in a row, between rows, and length of the rows.
    rows : int
        Number of rows.
    variety : float
        Variation among the trees, from 0 for equal ones to 1.
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
    for name, value in (("spacing", spacing), ("row", row), ("length", length)):
        require_positive(name, value, unit="m")
    require_count("rows", rows)
    require_fraction("variety", variety)
    dealer = ThingDealer(visit, things)
    rng = visit.structure_rng()
    for index in range(rows):
        y = row * (index - 0.5 * (rows - 1))
        _plant_row(dealer, rng, stations(spacing, 0.5 * length), y, (3.6, 1.1, 0.07), variety)
        for at in stations(6.0, 0.5 * length):
            position = (at + 0.5 * spacing, y + 0.32 * row, 0.0)
            dealer.deal(position, [crate, pallet, traffic.person], chance=0.2, shift=(1.5, 0.2))
    y = 0.0 if rows % 2 == 0 else 0.5 * row
    return dealer.finished("orchard", lane(-0.3 * length, 0.3 * length, y), 1.2, shifted(x=spacing))


def vineyard(
    visit: Visit,
    *,
    spacing: float = 5.0,
    row: float = 2.4,
    length: float = 80.0,
    rows: int = 16,
    variety: float = 0.5,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a vineyard on level ground: rows of posts along x with foliage between them.

    Crates and people are loose, one every 40 m of a row.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal fields.
    spacing, row, length : float [m]
        Distance between posts in a row, between rows, and length of the rows.
    rows : int
        Number of rows.
    variety : float
        Variation among the sections between two posts, from 0 for equal ones to 1.
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
    for name, value in (("spacing", spacing), ("row", row), ("length", length)):
        require_positive(name, value, unit="m")
    require_count("rows", rows)
    require_fraction("variety", variety)
    dealer = ThingDealer(visit, things)
    rng = visit.structure_rng()
    x = 0.5 * length
    for index in range(rows):
        y = row * (index - 0.5 * (rows - 1))
        feet = [[at, y, -0.3] for at in stations(spacing, x)]
        heads = [[at, y, 1.9] for at in stations(spacing, x)]
        dealer.builder.add(cones(feet, heads, 0.05, 0.05, SurfaceClass.POLE))
        dealer.builder.add(_vines(rng, stations(spacing, x), y, spacing, variety))
        for at in stations(8.0, x):
            dealer.deal((at, y + 0.05 * row, 0.0), [crate], chance=0.15, shift=(2.5, 0.1))
            dealer.deal((at, y + 0.15 * row, 0.0), [traffic.person], chance=0.1, shift=(2.5, 0.1))
    y = 0.0 if rows % 2 == 0 else 0.5 * row
    return dealer.finished(
        "vineyard", lane(-0.3 * length, 0.3 * length, y), 1.2, shifted(x=spacing)
    )


def _vines(
    rng: np.random.Generator, along: list[float], y: float, spacing: float, variety: float
) -> Surfaces:
    """Return the leaves of one row of vines, in equal sections from each post on."""
    shape = (len(along), int(30.0 * spacing), 3)
    section = rng.uniform([0.0, -0.25, 0.7], [spacing, 0.25, 1.8], shape[1:])
    offsets = variety * rng.normal(0.0, [0.3, 0.1, 0.2], shape)
    posts = np.array([[[x, y, 0.0]] for x in along])
    normals = np.broadcast_to(rng.normal(size=shape[1:]), shape)
    leaves = (posts + section + offsets).reshape(-1, 3)
    return discs(leaves, normals.reshape(-1, 3), 0.07, SurfaceClass.FOLIAGE)


def _plant_row(
    dealer: ThingDealer,
    rng: np.random.Generator,
    along: list[float],
    y: float,
    size: tuple[float, float, float],
    variety: float,
) -> None:
    """Add a row of trees of about a height, crown radius and trunk radius [m]."""
    model = int(rng.integers(2**31))
    for x in along:
        sizes = np.array(size) * (1.0 + variety * rng.uniform(-0.3, 0.3, 3))
        # Equal trees are copies of one model; others differ in their branches too.
        own = np.random.default_rng(model if variety == 0.0 else int(rng.integers(2**31)))
        one = plants.tree(
            own,
            height=sizes[0],
            crown_radius=sizes[1],
            trunk_radius=sizes[2],
            leaves=1.0 if math.hypot(x, y) < _DETAIL_DISTANCE else 0.15,
        )
        foot = np.array([x, y, 0.0]) + variety * np.append(rng.normal(0.0, 0.1, 2), 0.0)
        turn = rng.uniform(-math.pi, math.pi) if variety > 0.0 else 0.0
        dealer.builder.add(one, upright_pose(foot, turn))
