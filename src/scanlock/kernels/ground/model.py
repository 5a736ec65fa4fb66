"""Passes over the prototypes: patches, coarse ground heights, seeds, knots and extent."""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Points, Vector
from scanlock.kernels._compile import kernel


@kernel
def prototype_patches(
    ranges: Vector, starts: Labels, patch_sectors: int, first_ring: float, growth: float
) -> tuple[Labels, int]:
    """Return the patch ``patch_sector * rings + ring`` of each prototype, and the number of rings.

    The innermost ring ends at the range ``first_ring * growth`` [m], each further one at `growth`
    times the end of the one before. Sector s has the prototypes ``starts[s]:starts[s + 1]``,
    ordered by range.
    """
    sectors = starts.shape[0] - 1
    patch = np.empty(ranges.shape[0], np.int64)
    rings = 1
    for s in range(sectors):
        ring = 0
        end = first_ring * growth
        for i in range(starts[s], starts[s + 1]):
            while ranges[i] >= end:
                ring += 1
                end *= growth
            patch[i] = ring
        rings = max(rings, ring + 1)
    for s in range(sectors):
        for i in range(starts[s], starts[s + 1]):
            patch[i] += s * patch_sectors // sectors * rings
    return patch, rings


@kernel
def patch_members(
    patch: Labels,
    patch_count: int,
    chosen: Mask,
    on_plane: Mask,
    min_ratio: float,
    min_count: int,
) -> tuple[Labels, Labels, Labels, Mask]:
    """Return the chosen prototypes patch by patch, and the patches that growth may start from.

    Patch p has the prototypes ``members[first[p]:first[p + 1]]``. Growth may start from it if
    `min_ratio` of them, and at least `min_count`, are `on_plane`.

    Returns
    -------
    members : (n,)
    first : (patches + 1,)
    occupied : (patches,)
        Number of prototypes of each patch, chosen or not.
    start : (patches,)
    """
    first = np.zeros(patch_count + 1, np.int64)
    occupied = np.zeros(patch_count, np.int64)
    near = np.zeros(patch_count, np.int64)
    for i in range(patch.shape[0]):
        occupied[patch[i]] += 1
        first[patch[i] + 1] += chosen[i]
        near[patch[i]] += chosen[i] and on_plane[i]
    start = np.empty(patch_count, np.bool_)
    for p in range(patch_count):
        start[p] = near[p] >= max(min_ratio * first[p + 1], min_count)
        first[p + 1] += first[p]
    end = first[:patch_count].copy()
    members = np.empty(first[patch_count], np.int64)
    for i in range(patch.shape[0]):
        if chosen[i]:
            members[end[patch[i]]] = i
            end[patch[i]] += 1
    return members, first, occupied, start


@kernel
def blended_patch_heights(
    x: Vector,
    y: Vector,
    patch: Labels,
    patches: Matrix,
    accepted: Mask,
    patch_sectors: int,
    rings: int,
) -> Vector:
    """Return the height [m] of the coarse ground at each low point; NaN where there is none.

    The planes of the point's patch and of the eight around it (see `patches.grow_patches`) are
    averaged with weights of the inverse fourth power of the distance to their centres. The
    point's own patch has four times that weight.
    """
    n = x.shape[0]
    height = np.full(n, math.nan, np.float64)
    around = np.empty(9, np.int64)
    count = 0
    for i in range(n):
        # Neighbours in the list of low points often share a patch.
        if i == 0 or patch[i] != patch[i - 1]:
            count = 0
            own_ring = patch[i] % rings
            for across in range(-1, 2):
                sector = (patch[i] // rings + across) % patch_sectors
                for ring in range(max(own_ring - 1, 0), min(own_ring + 2, rings)):
                    if accepted[sector * rings + ring]:
                        around[count] = sector * rings + ring
                        count += 1
        weights = 0.0
        weighted = 0.0
        for q in around[:count]:
            dx = x[i] - patches[q, 3]
            dy = y[i] - patches[q, 4]
            closeness = 1.0 / (0.1 + dx * dx + dy * dy)
            weight = closeness * closeness
            if q == patch[i]:
                weight *= 4.0
            weights += weight
            weighted += weight * (patches[q, 0] + patches[q, 1] * dx + patches[q, 2] * dy)
        if weights > 0.0:
            height[i] = weighted / weights
    return height


@kernel
def select_seeds(
    heights: Vector,
    base: Vector,
    ranges: Vector,
    sharp: Mask,
    on_envelope: Mask,
    max_height: float,
    max_range: float,
    blunt_limit: float,
) -> tuple[Vector, Mask, Vector]:
    """Return heights above the base surface, the seeds, and the largest residuals [m].

    Seeds lie on the envelope, within `max_range` [m] and within `max_height` [m] of the base
    surface. Where the prototype of a cell is not `sharp`, its distance from the base surface, and
    its residual later on, must be below `blunt_limit` [m].
    """
    n = heights.shape[0]
    above = np.empty(n, np.float64)
    seeds = np.empty(n, np.bool_)
    max_residuals = np.empty(n, np.float64)
    for i in range(n):
        above[i] = heights[i] - base[i]
        max_residuals[i] = math.inf if sharp[i] else blunt_limit
        is_near = abs(above[i]) < min(max_height, max_residuals[i])
        seeds[i] = is_near and on_envelope[i] and ranges[i] < max_range
    return above, seeds, max_residuals


@kernel
def knots_between_prototypes(
    ranges: Vector,
    modelled: Vector,
    cells: Labels,
    starts: Labels,
    sharp: Mask,
    cell_count: int,
    min_step: float,
    limit: float,
    blunt_limit: float,
) -> Matrix:
    """Return the knots (cells, 5) of a model that is linear between the prototypes of a sector.

    `modelled` is the height [m] of the model at each prototype. The model is level beyond the
    first and the last prototype, and distances below `min_step` [m] count as `min_step`. See
    `point_passes.classify_points`.
    """
    knots = np.full((cell_count, 5), math.nan, np.float64)
    for s in range(starts.shape[0] - 1):
        slope = 0.0
        for i in range(starts[s], starts[s + 1]):
            knot = knots[cells[i]]
            knot[0] = ranges[i]
            knot[1] = modelled[i]
            knot[2] = slope
            slope = 0.0
            if i + 1 < starts[s + 1]:
                step = max(ranges[i + 1] - ranges[i], min_step)
                slope = (modelled[i + 1] - modelled[i]) / step
                slope = 0.0 if math.isnan(slope) else slope
            knot[3] = slope
            knot[4] = limit if sharp[i] else min(limit, blunt_limit)
    return knots


@kernel
def extent(points: Points, chosen: Mask, starts: Labels) -> tuple[int, float, int]:
    """Return the number of chosen points, their breadth, and the number of sectors with any.

    The breadth is the smallest standard deviation [m] along any direction of the xy plane. Sector
    s has the points ``starts[s]:starts[s + 1]``.
    """
    count = 0
    sectors = 0
    mean_x = mean_y = 0.0
    for s in range(starts.shape[0] - 1):
        before = count
        for i in range(starts[s], starts[s + 1]):
            if chosen[i]:
                count += 1
                mean_x += points[i, 0]
                mean_y += points[i, 1]
        sectors += count > before
    if count == 0:
        return 0, 0.0, 0
    mean_x /= count
    mean_y /= count
    xx = xy = yy = 0.0
    for i in range(points.shape[0]):
        if chosen[i]:
            x = points[i, 0] - mean_x
            y = points[i, 1] - mean_y
            xx += x * x
            xy += x * y
            yy += y * y
    # The smaller eigenvalue, as the product of both over the larger, which loses no digits.
    half = 0.5 * (xx - yy)
    larger = 0.5 * (xx + yy) + math.sqrt(half * half + xy * xy)
    smaller = max(xx * yy - xy * xy, 0.0) / larger if larger > 0.0 else 0.0
    return count, math.sqrt(smaller / count), sectors
