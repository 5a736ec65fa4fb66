"""Coarse ground: patches of low points, grown from one another as planes.

A patch is a row (h, gx, gy, x, y, radius): its plane has the height h at the patch's centre
(x, y) and the gradient (gx, gy); `radius` is the extent of the points that the plane was fitted
to. Patches are numbered ``sector * rings + ring``.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Vector
from scanlock.kernels._compile import helper, kernel
from scanlock.kernels._inline import adjugate, product

_Grid = tuple[int, int]
"""Sectors and rings of the patches."""

_Limit = tuple[float, float]
"""Largest residual [m] of a point of the ground, and its growth with the distance to accepted
patches [m/m]."""


@helper
def _fit_plane(
    members: Labels,
    x: Vector,
    y: Vector,
    z: Vector,
    limits: Vector,
    threshold: float,
    prior: Vector,
    prior_weight: float,
    slope_weight: float,
    fitted: Vector,
) -> tuple[int, int, float]:
    """Fit a plane to the low points near a predicted patch.

    Parameters
    ----------
    members
        Rows of the patch's low points in x, y, z.
    limits : (n,) [m]
        Largest residual of each low point in the first of three fits; `threshold` in the last.
    threshold : float [m]
    prior : (6,)
        Predicted patch.
    prior_weight : float
        Weight of its height, in points.
    slope_weight : float [m^2]
        Weight of its gradient, as the sum of squared distances of points.
    fitted : (6,)
        Overwritten by the plane and its radius.

    Returns
    -------
    count : int
        Points within `threshold` of the plane.
    predicted : int
        Those also within `threshold` of the prediction.
    rms : float [m]
    """
    h, gx, gy, cx, cy = prior[0], prior[1], prior[2], prior[3], prior[4]
    for attempt in range(3):
        widening = 1.0 - 0.5 * attempt
        a00 = prior_weight
        a01 = a02 = a12 = 0.0
        a11 = a22 = slope_weight
        r0 = prior_weight * prior[0]
        r1 = slope_weight * prior[1]
        r2 = slope_weight * prior[2]
        for m in range(members.shape[0]):
            i = members[m]
            dx = x[i] - cx
            dy = y[i] - cy
            limit = threshold + widening * (limits[i] - threshold)
            if abs(z[i] - h - gx * dx - gy * dy) >= limit:
                continue
            a00 += 1.0
            a01 += dx
            a02 += dy
            a11 += dx * dx
            a12 += dx * dy
            a22 += dy * dy
            r0 += z[i]
            r1 += dx * z[i]
            r2 += dy * z[i]
        adjugate_of_a, determinant = adjugate((a00, a01, a02, a11, a12, a22))
        h, gx, gy = product(adjugate_of_a, (r0, r1, r2))
        h, gx, gy = h / determinant, gx / determinant, gy / determinant
    count = 0
    predicted = 0
    squares = 0.0
    squared_distances = 0.0
    for m in range(members.shape[0]):
        i = members[m]
        dx = x[i] - cx
        dy = y[i] - cy
        residual = z[i] - h - gx * dx - gy * dy
        if abs(residual) < threshold:
            count += 1
            squares += residual * residual
            squared_distances += dx * dx + dy * dy
            if abs(z[i] - prior[0] - prior[1] * dx - prior[2] * dy) < threshold:
                predicted += 1
    if count == 0:
        return 0, 0, 0.0
    fitted[0], fitted[1], fitted[2] = h, gx, gy
    # The radius of a uniform disc is sqrt(2) times the rms distance of its points.
    fitted[5] = math.sqrt(2.0 * squared_distances / count)
    return count, predicted, math.sqrt(squares / count)


@helper
def _predict_plane(p: int, patches: Matrix, accepted: Mask, grid: _Grid, prior: Vector) -> bool:
    """Predict the plane of a patch from accepted patches around it; return whether there are any.

    The patches of the adjacent sectors and of two rings inwards and outwards are weighted by
    their inverse squared distances. The prediction is written to `prior`, at the patch's centre.
    """
    sectors, rings = grid
    ring_of_p = p % rings
    x = patches[p, 3]
    y = patches[p, 4]
    weights = h = gx = gy = 0.0
    for across in range(-1, 2):
        sector = (p // rings + across) % sectors
        for ring in range(max(ring_of_p - 2, 0), min(ring_of_p + 3, rings)):
            q = sector * rings + ring
            if not accepted[q]:
                continue
            dx = x - patches[q, 3]
            dy = y - patches[q, 4]
            weight = 1.0 / (0.01 + dx * dx + dy * dy)
            weights += weight
            h += weight * (patches[q, 0] + patches[q, 1] * dx + patches[q, 2] * dy)
            gx += weight * patches[q, 1]
            gy += weight * patches[q, 2]
    if weights == 0.0:
        return False
    prior[0], prior[1], prior[2] = h / weights, gx / weights, gy / weights
    prior[3], prior[4] = x, y
    return True


@helper
def _set_limits(
    p: int,
    members: Labels,
    x: Vector,
    y: Vector,
    patches: Matrix,
    accepted: Mask,
    grid: _Grid,
    limit: _Limit,
    limits: Vector,
) -> None:
    """Set the largest residual of each member: larger, the farther from accepted patches."""
    sectors, rings = grid
    ring_of_p = p % rings
    for m in range(members.shape[0]):
        i = members[m]
        nearest = math.inf
        for across in range(-1, 2):
            sector = (p // rings + across) % sectors
            for ring in range(max(ring_of_p - 2, 0), min(ring_of_p + 3, rings)):
                q = sector * rings + ring
                if accepted[q]:
                    dx = x[i] - patches[q, 3]
                    dy = y[i] - patches[q, 4]
                    nearest = min(nearest, math.sqrt(dx * dx + dy * dy) - patches[q, 5])
        limits[i] = limit[0] + limit[1] * max(nearest, 0.0)


@helper
def _predict_lower_level(
    p: int,
    members: Labels,
    z: Vector,
    patches: Matrix,
    accepted: Mask,
    grid: _Grid,
    threshold: float,
    prior: Vector,
) -> bool:
    """Return whether a patch may be ground at a lower level than the next accepted one inwards.

    It must be lower by more than `threshold`, and by less than the distance between the two. A
    horizontal plane at its mean height is written to `prior`.
    """
    sectors, rings = grid
    ring_of_p = p % rings
    mean = 0.0
    for m in range(members.shape[0]):
        mean += z[members[m]] / members.shape[0]
    prior[0], prior[1], prior[2] = mean, 0.0, 0.0
    prior[3], prior[4] = patches[p, 3], patches[p, 4]
    for ring in range(ring_of_p - 1, -1, -1):
        for across in (0, -1, 1):
            q = ((p // rings + across) % sectors) * rings + ring
            if accepted[q]:
                dx = patches[p, 3] - patches[q, 3]
                dy = patches[p, 4] - patches[q, 4]
                drop = patches[q, 0] - mean
                return drop > threshold and drop < math.sqrt(dx * dx + dy * dy)
    return False


@helper
def _is_plane(count: int, predicted: int, members: int, occupied: int, roughness: float) -> bool:
    """Return whether `count` of the members of a patch make its plane; see `grow_patches`.

    `predicted` of them are near the predicted plane; `roughness` is relative to its limit.
    """
    if count < 2 or 2 * count < members or roughness > 1.0:
        return False
    return 2 * predicted >= count or (count >= 6 and count >= 0.6 * occupied and roughness <= 0.7)


@helper
def _mark_neighbours(p: int, grid: _Grid, marks: Mask) -> None:
    """Mark the patches whose predictions depend on one; see `_predict_plane`."""
    sectors, rings = grid
    ring_of_p = p % rings
    for across in range(-1, 2):
        sector = (p // rings + across) % sectors
        for ring in range(max(ring_of_p - 2, 0), min(ring_of_p + 3, rings)):
            marks[sector * rings + ring] = True


@helper
def _empty_patches(x: Vector, y: Vector, members: Labels, first: Labels) -> Matrix:
    """Return patches at the centroids of their members, without planes."""
    patches = np.zeros((first.shape[0] - 1, 6), np.float64)
    for p in range(patches.shape[0]):
        for i in members[first[p] : first[p + 1]]:
            patches[p, 3] += x[i]
            patches[p, 4] += y[i]
        patches[p, 3] /= max(first[p + 1] - first[p], 1)
        patches[p, 4] /= max(first[p + 1] - first[p], 1)
    return patches


@kernel
def grow_patches(
    x: Vector,
    y: Vector,
    z: Vector,
    members: Labels,
    first: Labels,
    occupied: Labels,
    start: Mask,
    patch_sectors: int,
    rings: int,
    threshold: float,
    threshold_slope: float,
    prior_weight: float,
    slope_weight: float,
    max_roughness: float,
) -> tuple[Matrix, Mask]:
    """Grow the coarse ground from the patches in `start`; return (patches, accepted).

    A patch is accepted if at least half of its low points, and two of them, lie within `threshold`
    of a plane near the predicted one, with a roughness up to `max_roughness`. A plane away from the
    prediction needs more: six points, in six tenths of the patch's cells, with a roughness up to
    seven tenths of the limit. When growth ends, flat patches at a lower level than the next
    ground inwards are accepted and growth continues: beyond an edge the ground may go on at a
    lower level, and nothing lies beneath it.

    Parameters
    ----------
    x, y, z : (n,) [m]
        Low points.
    members, first
        Patch p has the low points ``members[first[p]:first[p + 1]]``.
    occupied : (patches,)
        Occupied cells of each patch.
    start : (patches,)
    patch_sectors, rings : int
    threshold : float [m]
        Largest residual of a point of the ground.
    threshold_slope : float
        Growth of the threshold with the distance to accepted patches.
    prior_weight : float
        Weight of a predicted height, in points.
    slope_weight : float [m^2]
        Weight of a predicted gradient.
    max_roughness : float [m]
        Largest rms of the residuals.
    """
    patches = _empty_patches(x, y, members, first)
    patch_count = patches.shape[0]
    grid, limit_of_distance = (patch_sectors, rings), (threshold, threshold_slope)
    accepted = np.zeros(patch_count, np.bool_)
    joining = np.zeros(patch_count, np.bool_)
    limits = np.full(x.shape[0], threshold, np.float64)
    prior = np.zeros(6, np.float64)
    fitted = np.zeros(6, np.float64)
    # A patch that was not accepted waits until one that it is predicted from has been accepted.
    due = np.ones(patch_count, np.bool_)
    sweep = 0
    is_lower_level = False
    while True:
        joined = 0
        for p in range(patch_count):
            n = first[p + 1] - first[p]
            if accepted[p] or n < 2 or not (due[p] or is_lower_level):
                continue
            due[p] = False
            own = members[first[p] : first[p + 1]]
            weight = prior_weight
            if sweep == 0:
                if not start[p]:
                    continue
                for c in range(6):
                    prior[c] = patches[p, c]
            elif is_lower_level:
                if n < 6 or not _predict_lower_level(
                    p, own, z, patches, accepted, grid, threshold, prior
                ):
                    continue
                # Not a prediction: all points are used, and the mean height has hardly any weight.
                for m in range(n):
                    limits[own[m]] = 1e9
                weight = 1e-3
            elif _predict_plane(p, patches, accepted, grid, prior):
                _set_limits(p, own, x, y, patches, accepted, grid, limit_of_distance, limits)
            else:
                continue
            count, predicted, rms = _fit_plane(
                own, x, y, z, limits, threshold, prior, weight, slope_weight, fitted
            )
            if not _is_plane(count, predicted, n, occupied[p], rms / max_roughness):
                continue
            for c in range(3):
                patches[p, c] = fitted[c]
            patches[p, 5] = fitted[5]
            joining[p] = True
            joined += 1
        for p in range(patch_count):
            if joining[p]:
                accepted[p] = True
                joining[p] = False
                _mark_neighbours(p, grid, due)
        if joined == 0 and is_lower_level:
            return patches, accepted
        # Lower levels are searched each time growth along the ground has ended.
        is_lower_level = joined == 0 and sweep > 0
        sweep += 1
