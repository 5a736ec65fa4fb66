"""Trees, shrubs, hedges and grass: stems of cones, and porous foliage of discs.

Every plant is at the origin of its own frame, with z up.
"""

import numpy as np

from scanlock.arrays import Points, Vector
from scanlock.simulation.objects.shapes import boxes, cones, discs, triangles
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces

_ROOTS = 0.4
"""Depth of stems below the ground [m], for slopes."""


def tree(
    rng: np.random.Generator,
    *,
    height: float,
    crown_radius: float,
    trunk_radius: float,
    leaves: float = 1.0,
) -> Surfaces:
    """Generate a broad-leaved tree: a leaning, tapering trunk, branches and a porous crown.

    Parameters
    ----------
    rng : Generator
    height, crown_radius, trunk_radius : float [m]
    leaves : float
        Factor on the number of leaves, whose total area does not change.
    """
    crown_base = height * rng.uniform(0.25, 0.45)
    joints = _leaning(rng, height * 0.8)
    radii = trunk_radius * np.array([1.25, 1.0, 0.8, 0.35])
    trunk = cones(joints[:-1], joints[1:], radii[:-1], radii[1:], SurfaceClass.TRUNK)

    middle = joints[2] + (joints[3] - joints[2]) * rng.uniform(0.2, 0.6)
    middle[2] = 0.5 * (crown_base + height)
    half = np.array([crown_radius, crown_radius * rng.uniform(0.75, 1.0), height - middle[2]])
    clumps = middle + half * _in_ball(rng, int(rng.integers(14, 26))) * 0.85
    forks = joints[1] + rng.uniform(0.4, 1.0, (len(clumps), 1)) * (joints[3] - joints[1])
    twig = 0.18 * trunk_radius
    branches = cones(forks, clumps, 2.0 * twig, 0.5 * twig, SurfaceClass.TRUNK)

    size = 0.045 * crown_radius / np.sqrt(leaves)
    count = int(rng.uniform(600, 1100) * leaves)
    centres = clumps[rng.integers(len(clumps), size=count)]
    centres = centres + rng.normal(size=(count, 3)) * (0.17 * half)
    return Surfaces.joined([trunk, branches, _leaves(rng, centres, size, SurfaceClass.FOLIAGE)])


def conifer(
    rng: np.random.Generator, *, height: float, radius: float, leaves: float = 1.0
) -> Surfaces:
    """Generate a conifer, with branches that shorten towards the tip; see `tree`."""
    joints = _leaning(rng, height)
    radii = 0.018 * height * np.array([1.2, 0.9, 0.5, 0.1])
    trunk = cones(joints[:-1], joints[1:], radii[:-1], radii[1:], SurfaceClass.TRUNK)
    count = int(rng.uniform(600, 1000) * leaves)
    # In whorls, denser towards the outside.
    level = np.round(rng.random(count) * 14.0) / 14.0 + rng.normal(0.0, 0.012, count)
    distance = radius * (1.05 - level) * np.sqrt(rng.uniform(0.05, 1.0, count))
    angle = rng.uniform(0.0, 2.0 * np.pi, count)
    z = height * (0.12 + 0.88 * np.clip(level, 0.0, 1.0)) - 0.25 * distance
    centres = np.column_stack([distance * np.cos(angle), distance * np.sin(angle), z])
    size = (0.05 * radius + 0.02) / np.sqrt(leaves)
    return Surfaces.joined([trunk, _leaves(rng, centres, size, SurfaceClass.FOLIAGE)])


def shrub(
    rng: np.random.Generator, *, radius: float, height: float, leaves: float = 1.0
) -> Surfaces:
    """Generate a shrub: a few stems, and clumps of leaves down to the ground; see `tree`."""
    lumps = _in_ball(rng, 7) * [radius, radius, 0.5 * height]
    lumps[:, 2] += 0.5 * height
    stems = cones(np.tile([0.0, 0.0, -_ROOTS], (7, 1)), lumps, 0.02, 0.01, SurfaceClass.SHRUB)
    count = int(rng.uniform(180, 320) * leaves)
    centres = lumps[rng.integers(7, size=count)]
    centres = centres + rng.normal(size=(count, 3)) * [0.3 * radius, 0.3 * radius, 0.18 * height]
    centres[:, 2] = np.abs(centres[:, 2])
    size = (0.06 * radius + 0.02) / np.sqrt(leaves)
    return Surfaces.joined([stems, _leaves(rng, centres, size, SurfaceClass.SHRUB)])


def hedge(rng: np.random.Generator, *, length: float, width: float, height: float) -> Surfaces:
    """Generate a clipped hedge along x, with a solid core and rough outer leaves."""
    core = boxes(
        [[0.0, 0.0, 0.5 * height - _ROOTS]],
        [[0.5 * length - 0.1, 0.5 * width - 0.12, 0.5 * height + _ROOTS - 0.12]],
        SurfaceClass.SHRUB,
    )
    count = int(70 * length * height)
    leaves = np.column_stack(
        [
            rng.uniform(-0.5, 0.5, count) * length,
            rng.choice([-0.5, 0.5], count) * width + rng.normal(0.0, 0.05, count),
            rng.uniform(0.0, height, count),
        ]
    )
    # A third of the leaves are on top.
    top = np.arange(count) % 3 == 0
    leaves[top, 1] = rng.uniform(-0.5, 0.5, int(top.sum())) * width
    leaves[top, 2] = height + rng.normal(0.0, 0.04, int(top.sum()))
    return Surfaces.joined([core, _leaves(rng, leaves, 0.07, SurfaceClass.SHRUB)])


def grass(rng: np.random.Generator, positions: Points, height: float) -> Surfaces:
    """Generate a tuft of four blades at each of (n, 3) positions."""
    blades = np.repeat(positions, 4, axis=0)
    n = len(blades)
    blades = blades + rng.normal(size=(n, 3)) * [0.04, 0.04, 0.0]
    angle = rng.uniform(0.0, 2.0 * np.pi, n)
    half_width = rng.uniform(0.006, 0.014, n)
    across = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)]) * half_width[:, None]
    tips = rng.normal(size=(n, 3)) * [0.3, 0.3, 0.0] + [0.0, 0.0, 1.0]
    tips *= (height * rng.uniform(0.5, 1.3, n))[:, None]
    foot = blades - [0.0, 0.0, 0.03]
    return triangles(
        np.stack([foot - across, foot + across, foot + tips], axis=1), SurfaceClass.GRASS
    )


def log(rng: np.random.Generator, *, length: float, radius: float) -> Surfaces:
    """Generate a fallen trunk along x."""
    rise = rng.uniform(-0.04, 0.04) * length
    ends = np.array([[-0.5 * length, 0.0, 0.7 * radius], [0.5 * length, 0.0, 0.7 * radius + rise]])
    return cones(ends[:1], ends[1:], radius, 0.7 * radius, SurfaceClass.TRUNK)


def _leaning(rng: np.random.Generator, height: float) -> Points:
    """Return four joints of a stem that leans and bends slightly."""
    lean = rng.normal(0.0, 0.05, 2)
    heights = np.array([-_ROOTS, 0.3 * height, 0.65 * height, height])
    bends = np.zeros((4, 2))
    bends[2:] = np.cumsum(rng.normal(0.0, 0.02, (2, 2)), axis=0) * height
    return np.column_stack([heights[:, None] * lean + bends, heights])


def _in_ball(rng: np.random.Generator, count: int) -> Points:
    """Draw points uniformly from the unit ball."""
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * rng.random((count, 1)) ** (1.0 / 3.0)


def _leaves(
    rng: np.random.Generator, centres: Points, size: float, label: SurfaceClass
) -> Surfaces:
    """Return a disc of about `size` [m] in radius at each centre, with a random orientation."""
    normals: Vector = rng.normal(size=centres.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    radii = size * rng.uniform(0.6, 1.5, (len(centres), 2))
    return discs(centres, normals, radii, label)
