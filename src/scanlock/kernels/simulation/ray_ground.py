"""Ray casting on the ground, a grid of heights with a bilinear patch in every cell."""

import math

import numpy as np

from scanlock.arrays import Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

TILE = 8
"""Cells along the side of a tile. A ray crosses a tile in one step where it is above it."""

_SEAM = 1e-9
"""Margin of a patch beyond its cell [m], so that no ray passes between two cells."""


@kernel
def cast_at_ground(
    origins: Points,
    directions: Points,
    limits: Vector,
    heights: Matrix,
    tops: Matrix,
    corner: Vector,
    cell: float,
) -> tuple[Vector, Vector]:
    """Return distance [m] and cosine of incidence of the ground hit by each (n, 3) ray.

    ``heights[i, j]`` [m] is the height at ``corner + cell * (i, j)``, and ``tops[i, j]`` the
    maximum of tile (i, j) with its borders. Directions are unit vectors; `limits` (n,) are maximum
    ranges [m]. A ray without a hit, such as one outside the grid, has infinity and 0.
    """
    n = origins.shape[0]
    distances = np.full(n, np.inf)
    cosines = np.zeros(n)
    ends = np.array([heights.shape[0] - 1.0, heights.shape[1] - 1.0])
    for i in range(n):
        # Horizontal coordinates in cells, so that a cell is a unit square.
        u, v = (origins[i, 0] - corner[0]) / cell, (origins[i, 1] - corner[1]) / cell
        du, dv = directions[i, 0] / cell, directions[i, 1] / cell
        enter, leave = _between(u, du, 0.0, ends[0], 0.0, limits[i])
        enter, leave = _between(v, dv, 0.0, ends[1], enter, leave)
        if enter < leave:
            dz = directions[i, 2]
            t = _cross_tiles(u, v, origins[i, 2], du, dv, dz, enter, leave, heights, tops)
            if t < np.inf:
                distances[i] = t
                cosines[i] = _cosine(
                    u + t * du, v + t * dv, du * cell, dv * cell, dz, heights, cell
                )
    return distances, cosines


@helper
def _between(
    start: float, rate: float, low: float, high: float, enter: float, leave: float
) -> tuple[float, float]:
    """Return the interval of t in [enter, leave] with ``start + rate * t`` in [low, high]."""
    if rate == 0.0:
        return (enter, leave) if low <= start <= high else (np.inf, -np.inf)
    a, b = (low - start) / rate, (high - start) / rate
    return max(enter, min(a, b)), min(leave, max(a, b))


@helper
def _cross_tiles(
    u: float,
    v: float,
    z: float,
    du: float,
    dv: float,
    dz: float,
    enter: float,
    leave: float,
    heights: Matrix,
    tops: Matrix,
) -> float:
    i = min(max(int((u + enter * du) / TILE), 0), tops.shape[0] - 1)
    j = min(max(int((v + enter * dv) / TILE), 0), tops.shape[1] - 1)
    step_i, step_j = (1 if du > 0.0 else -1), (1 if dv > 0.0 else -1)
    while True:
        exit_i = _exit(u, du, TILE * i, TILE * (i + 1))
        exit_j = _exit(v, dv, TILE * j, TILE * (j + 1))
        done = min(exit_i, exit_j, leave)
        if min(z + enter * dz, z + done * dz) <= tops[i, j]:
            t = _cross_cells(u, v, z, du, dv, dz, enter, done, i * TILE, j * TILE, heights)
            if t < np.inf:
                return t
        if done >= leave:
            return np.inf
        enter = done
        if exit_i < exit_j:
            i += step_i
        else:
            j += step_j
        if i < 0 or j < 0 or i >= tops.shape[0] or j >= tops.shape[1]:
            return np.inf


@helper
def _exit(start: float, rate: float, low: float, high: float) -> float:
    if rate == 0.0:
        return np.inf
    return ((high if rate > 0.0 else low) - start) / rate


@helper
def _cross_cells(
    u: float,
    v: float,
    z: float,
    du: float,
    dv: float,
    dz: float,
    enter: float,
    leave: float,
    first_i: int,
    first_j: int,
    heights: Matrix,
) -> float:
    """Return the distance to the ground of a tile, which the ray crosses from enter to leave."""
    last_i = min(first_i + TILE, heights.shape[0] - 1) - 1
    last_j = min(first_j + TILE, heights.shape[1] - 1) - 1
    i = min(max(int(u + enter * du), first_i), last_i)
    j = min(max(int(v + enter * dv), first_j), last_j)
    step_i, step_j = (1 if du > 0.0 else -1), (1 if dv > 0.0 else -1)
    while True:
        exit_i, exit_j = _exit(u, du, i, i + 1), _exit(v, dv, j, j + 1)
        done = min(exit_i, exit_j, leave)
        t = _cross_patch(
            u + enter * du - i, v + enter * dv - j, z + enter * dz, du, dv, dz, done - enter,
            heights[i, j], heights[i + 1, j], heights[i, j + 1], heights[i + 1, j + 1],
        )  # fmt: skip
        if t < np.inf:
            return enter + t
        if done >= leave:
            return np.inf
        enter = done
        if exit_i < exit_j:
            i += step_i
        else:
            j += step_j
        if i < first_i or j < first_j or i > last_i or j > last_j:
            return np.inf


@helper
def _cross_patch(
    u: float,
    v: float,
    z: float,
    du: float,
    dv: float,
    dz: float,
    length: float,
    h00: float,
    h10: float,
    h01: float,
    h11: float,
) -> float:
    """Return the t in [0, length] at which ``z + dz t`` is ``h00 + b u + c v + d u v``."""
    b, c, d = h10 - h00, h01 - h00, h00 - h10 - h01 + h11
    constant = z - (h00 + b * u + c * v + d * u * v)
    linear = dz - (b * du + c * dv + d * (u * dv + v * du))
    square = -d * du * dv
    best = np.inf
    root = linear * linear - 4.0 * square * constant
    if root >= 0.0:
        # Both roots without cancellation.
        q = -0.5 * (linear + math.copysign(math.sqrt(root), linear))
        far = q / square if square != 0.0 else np.inf
        near = constant / q if q != 0.0 else far
        for t in (near, far):
            if -_SEAM <= t <= length + _SEAM and max(t, 0.0) < best:
                best = max(t, 0.0)
    return best


@helper
def _cosine(
    u: float, v: float, dx: float, dy: float, dz: float, heights: Matrix, cell: float
) -> float:
    """Return the cosine between a ray and the normal of the ground at (u, v)."""
    i = min(max(int(u), 0), heights.shape[0] - 2)
    j = min(max(int(v), 0), heights.shape[1] - 2)
    h00, h10, h01, h11 = heights[i, j], heights[i + 1, j], heights[i, j + 1], heights[i + 1, j + 1]
    twist = h00 - h10 - h01 + h11
    slope_x = (h10 - h00 + twist * (v - j)) / cell
    slope_y = (h01 - h00 + twist * (u - i)) / cell
    return abs(slope_x * dx + slope_y * dy - dz) / math.sqrt(1.0 + slope_x**2 + slope_y**2)
