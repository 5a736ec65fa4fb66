"""Where a ray meets a surface, from the definition of the surface.

The solids are convex, so how far outside of one a point of a ray is (its gauge) is a convex
function of the distance along the ray: its least value tells whether the ray meets the solid at
all, and the crossing is bracketed ever closer. Nothing is solved for.
"""

import itertools

import numpy as np

FAR = 1e3


def gauge(kind, sizes, p):
    """A convex function of local points (..., 3) that is negative inside and zero on the solid."""
    a, b, c = sizes
    x, y, z = np.moveaxis(np.asarray(p), -1, 0)
    if kind == "box":
        return np.max([abs(x) / a, abs(y) / b, abs(z) / c], axis=0) - 1
    if kind == "ellipsoid":
        return np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2) - 1
    if kind == "cone":
        radius = a + (b - a) * (z + c) / (2 * c)
        return np.max([np.hypot(x, y) - radius, abs(z) - c], axis=0)
    raise AssertionError(kind)


def to_local(row, points):
    """Points in the axes of a surface."""
    return (points - row[:3]) @ row[3:12].reshape(3, 3).T


def nearest_approach(kind, row, origin, direction):
    """The distance along the ray at which the gauge is least, and that least value."""

    low, high = 0.0, FAR
    for _ in range(14):
        t = np.linspace(low, high, 41)
        value = gauge(kind, row[12:], to_local(row, origin + t[:, None] * direction))
        least = int(np.argmin(value))
        low, high = t[max(least - 1, 0)], t[min(least + 1, 40)]
    return t[least], value[least]


def crossing(kind, row, origin, direction):
    """The first distance at which a ray crosses a surface, infinity where it never does."""
    if kind in ("disc", "triangle"):
        return _flat_crossing(kind, row, origin, direction)

    def outside(t):
        return gauge(kind, row[12:], to_local(row, origin + t[:, None] * direction)) > 0

    low, high = 0.0, FAR
    first = outside(np.zeros(1))[0]
    if first:
        high, least = nearest_approach(kind, row, origin, direction)
        if least > 0:
            return np.inf
    for _ in range(14):
        t = np.linspace(low, high, 41)
        change = int(np.argmax(outside(t) != first))
        low, high = t[change - 1], t[change]
    return (low + high) / 2


def _flat_crossing(kind, row, origin, direction):
    normal = row[9:12]
    rate = normal @ direction
    if rate == 0:
        return np.inf
    t = normal @ (row[:3] - origin) / rate
    if t <= 0:
        return np.inf
    x, y, _ = to_local(row, origin + t * direction)
    a, b, c = row[12:]
    if kind == "disc":
        return t if (x / a) ** 2 + (y / b) ** 2 <= 1 else np.inf
    corners = np.array([[0, 0], [a, 0], [b, c]])
    sides = np.roll(corners, -1, axis=0) - corners
    gaps = np.array([x, y]) - corners
    turns = sides[:, 0] * gaps[:, 1] - sides[:, 1] * gaps[:, 0]
    return t if (turns >= 0).all() or (turns <= 0).all() else np.inf


def clearance(kind, row, origin, direction):
    """How far a ray is from touching the edge of a surface; near 0 rounding may decide."""
    if kind not in ("disc", "triangle"):
        return abs(nearest_approach(kind, row, origin, direction)[1])
    rate = row[9:12] @ direction
    if abs(rate) < 1e-6:
        return 0.0
    x, y, _ = to_local(row, origin + direction * (row[9:12] @ (row[:3] - origin)) / rate)
    a, b, c = row[12:]
    if kind == "disc":
        return abs(np.hypot(x / a, y / b) - 1)
    corners = np.array([[0, 0], [a, 0], [b, c]])
    sides = np.roll(corners, -1, axis=0) - corners
    gaps = np.array([x, y]) - corners
    turns = sides[:, 0] * gaps[:, 1] - sides[:, 1] * gaps[:, 0]
    return abs(turns / np.linalg.norm(sides, axis=1)).min()


def incidence_cosine(kind, row, place, direction):
    """The cosine between a ray and the normal at a place on a surface, by differences."""
    if kind in ("disc", "triangle"):
        return abs(row[9:12] @ direction)
    step = 1e-6
    gradient = np.array(
        [
            gauge(kind, row[12:], to_local(row, place + step * axis))
            - gauge(kind, row[12:], to_local(row, place - step * axis))
            for axis in np.eye(3)
        ]
    )
    return abs(gradient @ direction) / np.linalg.norm(gradient)


def height(heights, corner, cell, x, y):
    """The bilinear height at one place, the weights by the areas across."""
    u, v = (x - corner[0]) / cell, (y - corner[1]) / cell
    i = min(max(int(np.floor(u)), 0), heights.shape[0] - 2)
    j = min(max(int(np.floor(v)), 0), heights.shape[1] - 2)
    weights = np.outer([1 - (u - i), u - i], [1 - (v - j), v - j])
    return float((weights * heights[i : i + 2, j : j + 2]).sum())


def ground_crossing(heights, corner, cell, origin, direction, limit):
    """The first distance at which a ray crosses the ground, infinity where it never does.

    Between two grid lines the height under the ray is a quadratic in the distance, which three
    samples of it determine.
    """
    cuts = [0.0, limit]
    for axis, count in enumerate(heights.shape):
        if direction[axis] != 0:
            lines = corner[axis] + cell * np.arange(count)
            cuts.extend((lines - origin[axis]) / direction[axis])
    cuts = np.unique([t for t in cuts if 0 <= t <= limit])

    def gap(t):
        x, y, z = origin + t * direction
        return z - height(heights, corner, cell, x, y)

    ends = cell * (np.array(heights.shape) - 1)
    for low, high in itertools.pairwise(cuts):
        middle = origin + (low + high) / 2 * direction
        if (middle[:2] < corner).any() or (middle[:2] > corner + ends).any():
            continue
        # The three samples stay inside the cell, clear of rounding at its sides.
        s = np.array([0.2, 0.5, 0.8])
        quadratic = np.polyfit(s, [gap(low + q * (high - low)) for q in s], 2)
        roots = np.roots(quadratic)
        real = roots[abs(roots.imag) < 1e-12].real
        inside = real[(real >= -1e-9) & (real <= 1 + 1e-9)]
        if len(inside):
            return low + float(inside.min()) * (high - low)
    return np.inf
