"""Intersections of rays and surfaces by bracketing, from the definition of the surface.

The solids are convex, so their gauge (a measure of how far outside a point is) is a convex function
of the distance along a ray. Its minimum determines whether the ray hits the solid, and the crossing
is bracketed by subdivision. No equation is solved.
"""

import itertools

import numpy as np

FAR = 1e3


def gauge(kind, sizes, p):
    """Convex function of local points (..., 3), negative inside and zero on the solid."""
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
    """Points in the frame of a surface."""
    return (points - row[:3]) @ row[3:12].reshape(3, 3).T


def nearest_approach(kind, row, origin, direction):
    """Distance along the ray with the minimum gauge, and the minimum."""

    low, high = 0.0, FAR
    for _ in range(14):
        t = np.linspace(low, high, 41)
        value = gauge(kind, row[12:], to_local(row, origin + t[:, None] * direction))
        lowest = int(np.argmin(value))
        low, high = t[max(lowest - 1, 0)], t[min(lowest + 1, 40)]
    return t[lowest], value[lowest]


def crossing(kind, row, origin, direction):
    """First distance at which a ray crosses a surface; infinity if it never does."""
    if kind in ("disc", "triangle"):
        return _flat_crossing(kind, row, origin, direction)
    ahead = row[:3] - origin
    # Far rays first, of which there are many: a solid is within this radius of its centre.
    if np.linalg.norm(ahead - (ahead @ direction) * direction) > np.linalg.norm(row[12:]):
        return np.inf

    def outside(t):
        return gauge(kind, row[12:], to_local(row, origin + t[:, None] * direction)) > 0

    low, high = 0.0, FAR
    first = outside(np.zeros(1))[0]
    if first:
        high, minimum = nearest_approach(kind, row, origin, direction)
        if minimum > 0:
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
    offsets = np.array([x, y]) - corners
    turns = sides[:, 0] * offsets[:, 1] - sides[:, 1] * offsets[:, 0]
    return t if (turns >= 0).all() or (turns <= 0).all() else np.inf


def clearance(kind, row, origin, direction):
    """Distance of a ray from the edge of a surface; near 0, rounding decides whether it hits."""
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
    offsets = np.array([x, y]) - corners
    turns = sides[:, 0] * offsets[:, 1] - sides[:, 1] * offsets[:, 0]
    return abs(turns / np.linalg.norm(sides, axis=1)).min()


def incidence_cosine(kind, row, point, direction):
    """Cosine between a ray and the normal at a point of a surface, by finite differences."""
    if kind in ("disc", "triangle"):
        return abs(row[9:12] @ direction)
    step = 1e-6
    gradient = np.array(
        [
            gauge(kind, row[12:], to_local(row, point + step * axis))
            - gauge(kind, row[12:], to_local(row, point - step * axis))
            for axis in np.eye(3)
        ]
    )
    return abs(gradient @ direction) / np.linalg.norm(gradient)


def height(heights, corner, cell, x, y):
    """Bilinear height at one position."""
    u, v = (x - corner[0]) / cell, (y - corner[1]) / cell
    i = min(max(int(np.floor(u)), 0), heights.shape[0] - 2)
    j = min(max(int(np.floor(v)), 0), heights.shape[1] - 2)
    weights = np.outer([1 - (u - i), u - i], [1 - (v - j), v - j])
    return float((weights * heights[i : i + 2, j : j + 2]).sum())


def ground_crossing(heights, corner, cell, origin, direction, max_distance):
    """First distance at which a ray crosses the ground; infinity if it never does.

    Between two grid lines the height below the ray is a quadratic function of the distance, which
    three samples determine.
    """
    grid_distances = [0.0, max_distance]
    for axis, count in enumerate(heights.shape):
        if direction[axis] != 0:
            lines = corner[axis] + cell * np.arange(count)
            grid_distances.extend((lines - origin[axis]) / direction[axis])
    grid_distances = np.unique([t for t in grid_distances if 0 <= t <= max_distance])

    def height_above(t):
        x, y, z = origin + t * direction
        return z - height(heights, corner, cell, x, y)

    ends = cell * (np.array(heights.shape) - 1)
    for low, high in itertools.pairwise(grid_distances):
        middle = origin + (low + high) / 2 * direction
        if (middle[:2] < corner).any() or (middle[:2] > corner + ends).any():
            continue
        # The samples are inside the cell, away from rounding at its sides.
        s = np.array([0.2, 0.5, 0.8])
        quadratic = np.polyfit(s, [height_above(low + q * (high - low)) for q in s], 2)
        roots = np.roots(quadratic)
        real = roots[abs(roots.imag) < 1e-12].real
        inside = real[(real >= -1e-9) & (real <= 1 + 1e-9)]
        if len(inside):
            return low + float(inside.min()) * (high - low)
    return np.inf
