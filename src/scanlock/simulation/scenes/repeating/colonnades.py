"""Colonnades and platforms: columns at equal distances, with seats and people between them."""

from scanlock.errors import require_positive
from scanlock.simulation.objects import traffic
from scanlock.simulation.objects.movables import (
    bench,
    bicycle,
    chair,
    crate,
    planter,
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
    stations,
)
from scanlock.simulation.scenes.repeating.visit import Visit


def colonnade(
    visit: Visit,
    *,
    spacing: float = 4.0,
    width: float = 5.0,
    height: float = 4.5,
    radius: float = 0.35,
    length: float = 120.0,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a covered walk along x: columns on one side, a wall with pilasters on the other.

    Benches, planters, chairs, bicycles, boxes and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal walks.
    spacing, width, height, radius, length : float [m]
        Distance between the columns, width and height of the walk, radius of the columns, and
        length of the walk.
    things : float
        Factor on the number of loose things; 1 is one to four every 8 m.

    Returns
    -------
    RepeatingWorld

    Raises
    ------
    InvalidInput
        Sizes that are not positive.
    """
    for name, value in (
        ("spacing", spacing), ("width", width), ("height", height), ("radius", radius),
        ("length", length),
    ):  # fmt: skip
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    x, y = 0.5 * length, 0.5 * width
    feet = [[at, -y, -0.1] for at in stations(spacing, x)]
    heads = [[at, -y, height] for at in stations(spacing, x)]
    dealer.builder.add(cones(feet, heads, radius, 0.9 * radius, SurfaceClass.BUILDING))
    spans = [(-x, x, -y - 0.5, y, height, height + 0.5), (-x, x, y, y + 0.4, -0.1, height)]
    for at in stations(spacing, x):
        spans.append((at - 0.3, at + 0.3, y - 0.15, y, -0.1, height))
        plinth = 1.3 * radius
        spans.append((at - plinth, at + plinth, -y - plinth, -y + plinth, -0.1, 0.3))
    dealer.builder.add(blocks(spans, SurfaceClass.BUILDING))
    makes = [bench, planter, chair, bicycle, crate, traffic.person, table]
    for at in stations(2.0, x):
        for side, out in ((-1.0, 0.6), (1.0, 0.5)):
            position = (at, side * (y - out), 0.0)
            dealer.deal(position, makes, chance=0.3, shift=(0.3, 0.1), turn=0.4)
    for at in stations(6.0, x):
        dealer.deal((at, -y - 3.0, 0.0), [*makes, traffic.car], chance=0.4, shift=(1.5, 1.0))
    places = lane(-0.3 * length, 0.3 * length)
    return dealer.finished("colonnade", places, 1.2, shifted(x=spacing))


def platform(
    visit: Visit,
    *,
    spacing: float = 6.0,
    width: float = 7.0,
    length: float = 200.0,
    things: float = 1.0,
) -> RepeatingWorld:
    """Generate a railway platform along x between two tracks, with a roof on a row of posts.

    Benches, bins, trolleys and people are loose.

    Parameters
    ----------
    visit : Visit
        Its part is one of several equal platforms.
    spacing, width, length : float [m]
        Distance between the posts, width and length of the platform.
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
    for name, value in (("spacing", spacing), ("width", width), ("length", length)):
        require_positive(name, value, unit="m")
    dealer = ThingDealer(visit, things)
    x, y, top = 0.5 * length, 0.5 * width, 0.76
    spans = [(-x, x, -y, y, -0.1, top), (-0.4 * length, 0.4 * length, -0.8 * y, 0.8 * y, 4.2, 4.4)]
    for side in (-1.0, 1.0):
        for rail in (side * (y + 0.9), side * (y + 2.34)):
            spans.append((-x, x, rail - 0.035, rail + 0.035, -0.1, 0.17))
    for at in stations(spacing, 0.4 * length):
        spans.append((at - 0.12, at + 0.12, -0.12, 0.12, top, 4.2))
        spans.append((at - 0.06, at + 0.06, -0.8 * y, 0.8 * y, 3.95, 4.2))
    dealer.builder.add(blocks(spans, SurfaceClass.BUILDING))
    masts = [[at, side * (y + 4.2)] for at in stations(8.0 * spacing, x) for side in (-1.0, 1.0)]
    feet, heads = ([[*at, z] for at in masts] for z in (-0.1, 7.5))
    dealer.builder.add(cones(feet, heads, 0.15, 0.1, SurfaceClass.POLE))
    for at in stations(3.0, x):
        for side in (-1.0, 1.0):
            dealer.deal(
                (at, side * 0.75 * y, top), [traffic.person, traffic.person, trolley, crate],
                chance=0.25, shift=(1.2, 0.2),
            )  # fmt: skip
        position = (at + 0.5 * spacing, 0.0, top)
        dealer.deal(position, [bench, planter, crate], chance=0.25, shift=(0.8, 0.1), turn=0.1)
    places = lane(-0.25 * length, 0.25 * length, 0.42 * y, top)
    return dealer.finished("platform", places, 1.3, shifted(x=spacing))
