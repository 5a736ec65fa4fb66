"""Streets of equal houses, straight or at a crossing, with parked cars, bins and people."""

import math

import numpy as np

from scanlock.errors import require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.objects import buildings, furniture, traffic
from scanlock.simulation.objects.movables import bicycle, crate, planter, rubbish_bins
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

_GARDEN = 3.0
"""Depth of the front gardens [m]."""

_PAVEMENT = 2.0
"""Width of a pavement [m]."""

_CLEAR = 4.0
"""Length without parked cars at a crossing, behind the kerb of the other street [m]."""


def terraced_street(
    visit: Visit,
    *,
    width: float = 6.5,
    road: float = 8.0,
    houses: int = 31,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a street along x between two rows of equal houses with front gardens.

    Parked cars, bins, bicycles, planters and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal streets.
    width, road : float [m]
        Width of a house, and of the road.
    houses : int
        Number of houses on each side.
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
    require_count("houses", houses)
    for name, value in (("width", width), ("road", road)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    home = _home(visit.structure_rng(), width)
    half, kerb = 0.5 * width * houses, 0.5 * road
    for turn in (0.0, math.pi):
        _build_row(dealer, home, Pose(_turned(turn), np.zeros(3)), -half, half, width, kerb)
        _deal_row(dealer, turn, -half, half, width, kerb)
    places = lane(-0.3 * half, 0.3 * half)
    return dealer.finished("terraced_street", places, 1.8, shifted(x=width))


def crossroads(
    visit: Visit,
    *,
    width: float = 6.5,
    road: float = 8.0,
    houses: int = 9,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a crossing of four equal streets of equal houses.

    A quarter turn about the origin maps the structure to itself. Parked cars, bins, bicycles,
    planters and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal crossings.
    width, road : float [m]
        Width of a house, and of the roads.
    houses : int
        Number of houses on each side of each of the four streets.
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
    require_count("houses", houses)
    for name, value in (("width", width), ("road", road)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    home = _home(visit.structure_rng(), width)
    kerb = 0.5 * road
    # The gardens of two streets share a corner.
    low = kerb + _PAVEMENT + _GARDEN + 9.0
    high = low + width * houses
    corner = blocks([(kerb, low, kerb, low, -0.2, 0.12)], SurfaceClass.GROUND)
    for turn in 0.5 * math.pi * np.arange(4):
        dealer.builder.add(corner.moved(Pose(_turned(turn), np.zeros(3))))
        for flip in (0.0, math.pi):
            ends = (low, high) if flip == 0.0 else (-high, -low)
            pose = Pose(_turned(turn + flip), np.zeros(3))
            _build_row(dealer, home, pose, *ends, width, kerb)
            # Things stand nearer to the crossing than the houses.
            near, far = (_CLEAR + kerb, high) if flip == 0.0 else (-high, -_CLEAR - kerb)
            _deal_row(dealer, turn + flip, near, far, width, kerb)
    return dealer.finished(
        "crossroads", lane(-8.0, 9.0, -1.0), 1.8, Pose(_turned(0.5 * math.pi), np.zeros(3))
    )


def _turned(angle: float) -> np.ndarray:
    return exp_rotation(np.array([0.0, 0.0, angle]))


def _home(rng: np.random.Generator, width: float) -> Surfaces:
    """Return a house with its front garden; the pavement is along y = 0, and the house behind."""
    storeys = int(rng.integers(2, 4))
    house = buildings.house(rng, width=width, depth=9.0, storeys=storeys, forecourt=1.5)
    wall = furniture.garden_wall(rng, length=width - 1.4)
    side = float(rng.choice([-0.7, 0.7]))
    parts = [
        house.moved(upright_pose(np.array([0.0, _GARDEN, 0.1]), 0.0)),
        wall.moved(upright_pose(np.array([side, 0.1, 0.1]), 0.0)),
        blocks([(-0.5 * width, 0.5 * width, 0.0, _GARDEN, -0.2, 0.14)], SurfaceClass.GROUND),
    ]
    return Surfaces.joined(parts)


def _build_row(
    dealer: ThingDealer,
    home: Surfaces,
    pose: Pose,
    low: float,
    high: float,
    width: float,
    kerb: float,
) -> None:
    """Add houses and pavement at the left of the x axis, then turned by a pose."""
    for index in range(round((high - low) / width)):
        at = np.array([low + width * (index + 0.5), kerb + _PAVEMENT, 0.0])
        dealer.builder.add(home, pose @ upright_pose(at, 0.0))
    strip = (low, high, kerb, kerb + _PAVEMENT, -0.2, 0.12)
    dealer.builder.add(blocks([strip], SurfaceClass.GROUND).moved(pose))


def _deal_row(
    dealer: ThingDealer, turn: float, low: float, high: float, width: float, kerb: float
) -> None:
    """Deal cars along the kerb, and things on the pavement and in the gardens."""
    rotation = _turned(turn)
    makes = [rubbish_bins, rubbish_bins, bicycle, crate, planter, traffic.person]
    for x in [low + 5.8 * (0.5 + index) for index in range(int((high - low) // 5.8))]:
        at = rotation @ [x, kerb - 1.0, 0.0]
        flip = turn + math.pi
        dealer.deal(
            at.tolist(), [traffic.car], chance=0.5, yaw=flip, shift=(0.4, 0.1), turn=0.03
        )  # fmt: skip
    for index in range(round((high - low) / width)):
        for y in (kerb + 1.4, kerb + _PAVEMENT + 1.2):
            at = rotation @ [low + width * (index + 0.5), y, 0.13]
            dealer.deal(at.tolist(), makes, chance=0.4, yaw=turn, shift=(2.4, 0.3), turn=0.3)
