"""Ray casting: the first surface that each ray hits.

A surface is a row of 15 numbers: its centre (3) [m], the rotation from world to its own axes
(9, by rows), and three sizes [m] whose meaning depends on its kind:

=========== ======== =========================================================
0 box       a, b, c  half extents
1 cone      r, s, h  radius r at z = -h, radius s at z = +h, both ends closed
2 ellipsoid a, b, c  half axes
3 disc      a, b, -  half axes of an ellipse in the plane z = 0
4 triangle  a, b, c  corners (0, 0), (a, 0), (b, c) in the plane z = 0
=========== ======== =========================================================

A ray hits a surface at its first intersection in front of the origin, from outside or inside.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.kernels._compile import helper, kernel

BOX, CONE, ELLIPSOID, DISC, TRIANGLE = range(5)
NOTHING = -1

_STACK = 128
_FLAT = 1e-100  # a smaller component of a direction counts as zero, or its inverse overflows


@kernel
def cast_rays(
    origins: Points,
    directions: Points,
    limits: Vector,
    kinds: Labels,
    surfaces: Matrix,
    node_bounds: Matrix,
    node_link: Labels,
    node_count: Labels,
) -> tuple[Vector, Vector, Labels]:
    """Return distance [m], cosine of incidence and row of the first surface hit by each ray.

    Origins and directions (unit vectors) are (n, 3); `limits` (n,) are maximum ranges [m]. A ray
    without a hit in its range has infinity, 0 and NOTHING. The nodes are those of
    `scanlock.kernels.simulation.ray_tree.box_tree`, with the surfaces in the order of its leaves.
    """
    n = origins.shape[0]
    distances = np.full(n, np.inf)
    cosines = np.zeros(n)
    rows = np.full(n, NOTHING)
    if kinds.shape[0] == 0:
        return distances, cosines, rows
    stack = np.empty(_STACK, np.int64)
    entries = np.empty(_STACK)
    for i in range(n):
        x, y, z = origins[i, 0], origins[i, 1], origins[i, 2]
        dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
        t, k = _traverse(
            x, y, z, dx, dy, dz, limits[i], kinds, surfaces,
            node_bounds, node_link, node_count, stack, entries,
        )  # fmt: skip
        if k != NOTHING:
            distances[i], rows[i] = t, k
            cosines[i] = _cosine(x, y, z, dx, dy, dz, t, kinds[k], surfaces[k])
    return distances, cosines, rows


@kernel
def cast_at_movers(
    origins: Points,
    directions: Points,
    times: Vector,
    limits: Vector,
    kinds: Labels,
    surfaces: Matrix,
    first: Labels,
    frames: Matrix,
) -> tuple[Vector, Vector, Labels]:
    """Return the results of `cast_rays` for moving surfaces, with each ray at its own time [s].

    Mover m has the surfaces ``first[m] : first[m + 1]``, in its own frame. Row m of `frames` is
    its position at time 0 (3), the rotation from world to its frame (9, by rows), its velocity
    (3) [m/s] and the radius [m] of its bounding sphere about its origin.
    """
    n = origins.shape[0]
    distances = np.full(n, np.inf)
    cosines = np.zeros(n)
    rows = np.full(n, NOTHING)
    for m in range(frames.shape[0]):
        frame = frames[m]
        for i in range(n):
            x = origins[i, 0] - frame[0] - times[i] * frame[12]
            y = origins[i, 1] - frame[1] - times[i] * frame[13]
            z = origins[i, 2] - frame[2] - times[i] * frame[14]
            dx, dy, dz = directions[i, 0], directions[i, 1], directions[i, 2]
            # Most rays miss the bounding sphere.
            ahead = max(-(x * dx + y * dy + z * dz), 0.0)
            if x * x + y * y + z * z - ahead * ahead > frame[15] * frame[15]:
                continue
            ox = frame[3] * x + frame[4] * y + frame[5] * z
            oy = frame[6] * x + frame[7] * y + frame[8] * z
            oz = frame[9] * x + frame[10] * y + frame[11] * z
            vx = frame[3] * dx + frame[4] * dy + frame[5] * dz
            vy = frame[6] * dx + frame[7] * dy + frame[8] * dz
            vz = frame[9] * dx + frame[10] * dy + frame[11] * dz
            best, hit = min(limits[i], distances[i]), NOTHING
            for k in range(first[m], first[m + 1]):
                t = _surface(ox, oy, oz, vx, vy, vz, kinds[k], surfaces[k])
                if t < best:
                    best, hit = t, k
            if hit != NOTHING:
                distances[i], rows[i] = best, hit
                cosines[i] = _cosine(ox, oy, oz, vx, vy, vz, best, kinds[hit], surfaces[hit])
    return distances, cosines, rows


@helper
def _traverse(
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    max_range: float,
    kinds: Labels,
    surfaces: Matrix,
    node_bounds: Matrix,
    node_link: Labels,
    node_count: Labels,
    stack: Labels,
    entries: Vector,
) -> tuple[float, int]:
    """Return distance and index of the first surface nearer than `max_range`, or -1."""
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    best, hit = max_range, NOTHING
    depth = 0
    node = 0
    if not _entry(x, y, z, ix, iy, iz, best, node_bounds, 0) < best:
        return best, hit
    while True:
        if node_count[node] > 0:
            first = node_link[node]
            for k in range(first, first + node_count[node]):
                t = _surface(x, y, z, dx, dy, dz, kinds[k], surfaces[k])
                if t < best:
                    best, hit = t, k
        else:
            near, far = node + 1, node_link[node]
            t_near = _entry(x, y, z, ix, iy, iz, best, node_bounds, near)
            t_far = _entry(x, y, z, ix, iy, iz, best, node_bounds, far)
            if t_far < t_near:
                near, far = far, near
                t_near, t_far = t_far, t_near
            if t_far < best:
                stack[depth] = far
                entries[depth] = t_far
                depth += 1
            if t_near < best:
                node = near
                continue
        while depth > 0 and not entries[depth - 1] < best:
            depth -= 1
        if depth == 0:
            return best, hit
        depth -= 1
        node = stack[depth]


@helper
def _inverse(component: float) -> float:
    # With an infinite inverse, 0 * inf would be NaN on the face of a box.
    return 1.0 / component if abs(component) > _FLAT else 1.0 / _FLAT


@helper
def _entry(
    x: float,
    y: float,
    z: float,
    ix: float,
    iy: float,
    iz: float,
    best: float,
    bounds: Matrix,
    k: int,
) -> float:
    """Return the distance at which a ray enters box k; infinity if it misses."""
    a, b = (bounds[k, 0] - x) * ix, (bounds[k, 3] - x) * ix
    enter, leave = min(a, b), max(a, b)
    a, b = (bounds[k, 1] - y) * iy, (bounds[k, 4] - y) * iy
    enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    a, b = (bounds[k, 2] - z) * iz, (bounds[k, 5] - z) * iz
    enter, leave = max(enter, min(a, b)), min(leave, max(a, b))
    enter = max(enter, 0.0)
    return enter if enter <= min(leave, best) else np.inf


@helper
def _surface(
    x: float, y: float, z: float, dx: float, dy: float, dz: float, kind: int, s: Vector
) -> float:
    """Return the distance to the first intersection with a surface; infinity without any."""
    x, y, z = x - s[0], y - s[1], z - s[2]
    # The third axis alone excludes flat surfaces behind the origin.
    oz = s[9] * x + s[10] * y + s[11] * z
    vz = s[9] * dx + s[10] * dy + s[11] * dz
    if kind >= DISC and not oz * vz < 0.0:
        return np.inf
    ox = s[3] * x + s[4] * y + s[5] * z
    oy = s[6] * x + s[7] * y + s[8] * z
    vx = s[3] * dx + s[4] * dy + s[5] * dz
    vy = s[6] * dx + s[7] * dy + s[8] * dz
    if kind >= DISC:
        t = -oz / vz
        px, py = ox + t * vx, oy + t * vy
        if kind == DISC:
            inside = (px / s[12]) ** 2 + (py / s[13]) ** 2 <= 1.0
        else:
            v = py / s[14]
            u = (px - s[13] * v) / s[12]
            inside = u >= 0.0 and v >= 0.0 and u + v <= 1.0
        return t if inside else np.inf
    if kind == BOX:
        return _box(ox, oy, oz, vx, vy, vz, s[12], s[13], s[14])
    if kind == CONE:
        return _cone(ox, oy, oz, vx, vy, vz, s[12], s[13], s[14])
    a, b, c = s[12], s[13], s[14]
    ox, oy, oz, vx, vy, vz = ox / a, oy / b, oz / c, vx / a, vy / b, vz / c
    near, far = _roots(
        vx * vx + vy * vy + vz * vz,
        ox * vx + oy * vy + oz * vz,
        ox * ox + oy * oy + oz * oz - 1.0,
    )
    return near if near > 0.0 else far if far > 0.0 else np.inf


@helper
def _roots(a: float, b: float, c: float) -> tuple[float, float]:
    """Return the roots of ``a t^2 + 2 b t + c`` in ascending order, infinities without any."""
    square = b * b - a * c
    if not square >= 0.0:
        return np.inf, np.inf
    # Both roots without cancellation.
    q = -(b + math.copysign(math.sqrt(square), b))
    s = q / a if a != 0.0 else np.inf
    t = c / q if q != 0.0 else (0.0 if a != 0.0 else np.inf)
    return min(s, t), max(s, t)


@helper
def _box(
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    a: float,
    b: float,
    c: float,
) -> float:
    ix, iy, iz = _inverse(dx), _inverse(dy), _inverse(dz)
    s, t = (-a - x) * ix, (a - x) * ix
    enter, leave = min(s, t), max(s, t)
    s, t = (-b - y) * iy, (b - y) * iy
    enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
    s, t = (-c - z) * iz, (c - z) * iz
    enter, leave = max(enter, min(s, t)), min(leave, max(s, t))
    if enter > leave or not leave > 0.0:
        return np.inf
    return enter if enter > 0.0 else leave


@helper
def _cone(
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    bottom: float,
    top: float,
    half: float,
) -> float:
    slope = 0.5 * (top - bottom) / half
    radius = 0.5 * (top + bottom) + slope * z
    turn = slope * dz
    best = np.inf
    near, far = _roots(
        dx * dx + dy * dy - turn * turn,
        x * dx + y * dy - radius * turn,
        x * x + y * y - radius * radius,
    )
    if 0.0 < near < np.inf and abs(z + near * dz) <= half:
        best = near
    elif 0.0 < far < np.inf and abs(z + far * dz) <= half:
        best = far
    if abs(dz) > _FLAT:
        t = (-half - z) / dz
        if 0.0 < t < best and (x + t * dx) ** 2 + (y + t * dy) ** 2 <= bottom * bottom:
            best = t
        t = (half - z) / dz
        if 0.0 < t < best and (x + t * dx) ** 2 + (y + t * dy) ** 2 <= top * top:
            best = t
    return best


@helper
def _cosine(
    x: float,
    y: float,
    z: float,
    dx: float,
    dy: float,
    dz: float,
    t: float,
    kind: int,
    s: Vector,
) -> float:
    """Return the cosine between a ray and the normal of a surface at distance t."""
    vx = s[3] * dx + s[4] * dy + s[5] * dz
    vy = s[6] * dx + s[7] * dy + s[8] * dz
    vz = s[9] * dx + s[10] * dy + s[11] * dz
    if kind >= DISC:
        return abs(vz)
    x, y, z = x + t * dx - s[0], y + t * dy - s[1], z + t * dz - s[2]
    px = s[3] * x + s[4] * y + s[5] * z
    py = s[6] * x + s[7] * y + s[8] * z
    pz = s[9] * x + s[10] * y + s[11] * z
    a, b, c = s[12], s[13], s[14]
    if kind == BOX:
        nx, ny, nz = abs(px) - a, abs(py) - b, abs(pz) - c
        if nx >= ny and nx >= nz:
            return abs(vx)
        return abs(vy) if ny >= nz else abs(vz)
    if kind == CONE:
        slope = 0.5 * (b - a) / c
        radius = 0.5 * (a + b) + slope * pz
        if abs(pz) - c >= math.sqrt(px * px + py * py) - radius:
            return abs(vz)
        nx, ny, nz = px, py, -slope * radius
    else:
        nx, ny, nz = px / (a * a), py / (b * b), pz / (c * c)
    return abs(nx * vx + ny * vy + nz * vz) / math.sqrt(nx * nx + ny * ny + nz * nz)
