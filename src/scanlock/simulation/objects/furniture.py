"""Poles, signs, fences and other objects along streets and paths.

Every object is at the origin of its own frame with z up; long objects extend along x.
"""

import numpy as np

from scanlock.simulation.objects.shapes import boxes, cones, discs, ellipsoids, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_DEPTH = 0.4
"""Depth of objects below the ground [m], for slopes."""


def street_lamp(rng: np.random.Generator) -> Surfaces:
    """Generate a lamp post with an arm along y."""
    height = rng.uniform(5.5, 9.0)
    arm = rng.uniform(0.8, 2.0)
    radius = rng.uniform(0.06, 0.11)
    lean = rng.normal(0.0, 0.008, 2) * height
    top = np.array([lean[0], lean[1], height])
    head = top + np.array([0.0, arm, rng.uniform(-0.1, 0.3)])
    post = cones(
        [np.array([0.0, 0.0, -_DEPTH]), top], [top, head], [radius, 0.04], [0.6 * radius, 0.035],
        SurfaceClass.POLE,
    )  # fmt: skip
    foot = cones([[0.0, 0.0, -_DEPTH]], [[0.0, 0.0, rng.uniform(0.5, 1.1)]], 1.5 * radius,
                 1.4 * radius, SurfaceClass.POLE)  # fmt: skip
    lamp = ellipsoids([head], [[0.12, 0.35, 0.09]], SurfaceClass.POLE)
    return Surfaces.joined([post, foot, lamp])


def traffic_sign(rng: np.random.Generator) -> Surfaces:
    """Generate a sign on a thin post, facing along x."""
    height = rng.uniform(2.0, 2.9)
    radius = 0.03
    post = cones(
        [[0.0, 0.0, -_DEPTH]], [[*rng.normal(0.0, 0.03, 2), height]], radius, radius,
        SurfaceClass.POLE,
    )  # fmt: skip
    if rng.random() < 0.6:
        plate = discs(
            [[0.04, 0.0, height - 0.3]], [[1.0, 0.0, 0.0]], rng.uniform(0.25, 0.38),
            SurfaceClass.POLE,
        )  # fmt: skip
    else:
        plate = boxes(
            [[0.05, 0.0, height - 0.35]], [[0.01, *rng.uniform(0.2, 0.45, 2)]], SurfaceClass.POLE
        )
    return Surfaces.joined([post, plate])


def traffic_light(rng: np.random.Generator) -> Surfaces:
    """Generate a signal head on a post."""
    height = rng.uniform(2.9, 3.4)
    post = cones([[0.0, 0.0, -_DEPTH]], [[0.0, 0.0, height]], 0.07, 0.06, SurfaceClass.POLE)
    head = boxes([[0.15, 0.0, height - 0.4]], [[0.12, 0.16, 0.45]], SurfaceClass.POLE)
    return Surfaces.joined([post, head])


def wooden_pole(rng: np.random.Generator) -> Surfaces:
    """Generate a pole of overhead wires with a cross arm."""
    height = rng.uniform(7.0, 10.0)
    lean = rng.normal(0.0, 0.015, 2) * height
    pole = cones([[0.0, 0.0, -_DEPTH]], [[*lean, height]], 0.15, 0.1, SurfaceClass.POLE)
    arm = boxes([[*lean, height - 0.4]], [[0.06, 1.0, 0.06]], SurfaceClass.POLE)
    return Surfaces.joined([pole, arm])


def bollards(rng: np.random.Generator, count: int) -> Surfaces:
    """Generate a row of short posts with uneven spacing."""
    x = np.cumsum(rng.uniform(1.0, 1.9, count))
    x -= x.mean()
    feet = np.column_stack([x, rng.normal(0.0, 0.03, count), np.full(count, -_DEPTH)])
    tops = feet + np.array([0.0, 0.0, _DEPTH + rng.uniform(0.7, 1.0)])
    return cones(feet, tops, 0.07, 0.07, SurfaceClass.POLE)


def fence(rng: np.random.Generator, *, length: float) -> Surfaces:
    """Generate a picket fence with some pickets missing."""
    height = rng.uniform(0.8, 1.4)
    posts = np.arange(-0.5 * length, 0.5 * length, rng.uniform(1.7, 2.6))
    pickets = np.arange(-0.5 * length, 0.5 * length, rng.uniform(0.14, 0.24))
    pickets = pickets[rng.random(len(pickets)) > 0.06]
    x = np.concatenate([posts, pickets])
    half_widths = np.concatenate([np.full(len(posts), 0.06), np.full(len(pickets), 0.04)])
    half_heights = np.concatenate(
        [np.full(len(posts), 0.5 * height + 0.05), 0.5 * height + rng.normal(0, 0.02, len(pickets))]
    )
    uprights = boxes(
        np.column_stack([x, np.zeros(len(x)), half_heights - 0.05]),
        np.column_stack([half_widths, np.full(len(x), 0.03), half_heights]),
        SurfaceClass.FENCE,
    )
    rails = boxes(
        [[0.0, 0.04, 0.3 * height], [0.0, 0.04, 0.8 * height]],
        [0.5 * length, 0.02, 0.04],
        SurfaceClass.FENCE,
    )
    return Surfaces.joined([uprights, rails])


def garden_wall(rng: np.random.Generator, *, length: float) -> Surfaces:
    """Generate a low wall with pillars."""
    height = rng.uniform(0.5, 1.3)
    pillars = np.arange(-0.5 * length, 0.5 * length + 0.1, rng.uniform(2.5, 4.0))
    wall = boxes([[0.0, 0.0, 0.5 * height - 0.2]], [[0.5 * length, 0.12, 0.5 * height + 0.2]],
                 SurfaceClass.FENCE)  # fmt: skip
    raised = 0.5 * height + 0.12
    piers = boxes(
        np.column_stack([pillars, np.zeros(len(pillars)), np.full(len(pillars), raised)]),
        [0.22, 0.2, raised + 0.1],
        SurfaceClass.FENCE,
    )
    return Surfaces.joined([wall, piers])


def bins(rng: np.random.Generator, count: int) -> Surfaces:
    """Generate a row of rubbish bins."""
    x = np.cumsum(rng.uniform(0.65, 0.9, count))
    half = np.column_stack(
        [rng.uniform(0.24, 0.32, count), rng.uniform(0.25, 0.38, count),
         rng.uniform(0.45, 0.6, count)]
    )  # fmt: skip
    centres = np.column_stack([x - x.mean(), rng.normal(0.0, 0.06, count), half[:, 2]])
    return boxes(centres, half, SurfaceClass.FURNITURE)


def boulder(rng: np.random.Generator) -> Surfaces:
    """Generate a rock, half below the ground."""
    half = rng.uniform(0.15, 0.6) * rng.uniform(0.6, 1.2, (3, 3))
    centres = rng.normal(0.0, 0.25, (3, 3)) * half
    return ellipsoids(centres, half, SurfaceClass.ROCK)


def gazebo(rng: np.random.Generator) -> Surfaces:
    """Generate an open octagonal pavilion: floor, posts, railings and a pointed roof."""
    radius = rng.uniform(2.4, 3.2)
    eaves = rng.uniform(2.3, 2.7)
    angles = (np.arange(9) + 0.5) * (np.pi / 4.0)
    corners = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    feet = np.column_stack([corners[:8], np.full(8, -_DEPTH)])
    heads = np.column_stack([corners[:8], np.full(8, eaves)])
    posts = cones(feet, heads, 0.08, 0.08, SurfaceClass.GAZEBO)
    floor = cones([[0.0, 0.0, -_DEPTH]], [[0.0, 0.0, 0.18]], radius + 0.1, radius + 0.1,
                  SurfaceClass.GAZEBO)  # fmt: skip
    # One side is open as an entrance.
    sides = np.arange(1, 8)
    low, high = corners[sides], corners[sides + 1]
    rails = [
        cones(
            np.column_stack([low, np.full(7, z)]), np.column_stack([high, np.full(7, z)]),
            0.035, 0.035, SurfaceClass.GAZEBO,
        )
        for z in (0.35, 1.05)
    ]  # fmt: skip
    fractions = np.linspace(0.0, 1.0, 12)[1:-1]
    pickets = (low[:, None] + fractions[:, None] * (high - low)[:, None]).reshape(-1, 2)
    balusters = cones(
        np.column_stack([pickets, np.full(len(pickets), 0.18)]),
        np.column_stack([pickets, np.full(len(pickets), 1.05)]),
        0.018, 0.018, SurfaceClass.GAZEBO,
    )  # fmt: skip
    return Surfaces.joined([posts, floor, *rails, balusters, _octagonal_roof(rng, radius, eaves)])


def _octagonal_roof(rng: np.random.Generator, radius: float, eaves: float) -> Surfaces:
    angles = (np.arange(9) + 0.5) * (np.pi / 4.0)
    rim = np.column_stack(
        [1.15 * radius * np.cos(angles), 1.15 * radius * np.sin(angles), np.full(9, eaves)]
    )
    tip = np.broadcast_to([0.0, 0.0, eaves + rng.uniform(1.2, 1.9)], (8, 3))
    roof = triangles(np.stack([rim[:8], rim[1:], tip], axis=1), SurfaceClass.GAZEBO)
    lantern = cones([tip[0]], [tip[0] + [0.0, 0.0, 0.6]], 0.12, 0.0, SurfaceClass.GAZEBO)
    return Surfaces.joined([roof, lantern])
