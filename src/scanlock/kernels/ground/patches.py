"""The coarse ground: patches of low points that continue one another as planes.

A patch is a row (h, gx, gy, x, y, radius): its plane has the height h at the patch's centre
(x, y) and the gradient (gx, gy); `radius` is how far the points reach that it was fitted to.
"""

import math

import numpy as np

from scanlock.arrays import Labels, Mask, Matrix, Vector
from scanlock.kernels._compile import kernel


@kernel
def fit_patch(
    members: Labels,
    x: Vector,
    y: Vector,
    z: Vector,
    gates: Vector,
    gate: float,
    prior: Vector,
    prior_weight: float,
    slope_weight: float,
    fitted: Vector,
) -> tuple[int, int, float]:
    """Fit the plane of a patch to the low points near it; return (points, as predicted, rms).

    `prior` is the predicted patch: its height counts as `prior_weight` points and its gradient
    as `slope_weight` square metres of them. `gates` are how far from the prediction each member
    may lie at first; the last of three rounds takes those within `gate`. The second number is
    how many of these lie within `gate` of the prediction too. The plane and its radius are
    written to `fitted`.
    """
    cx = prior[3]
    cy = prior[4]
    h = prior[0]
    gx = prior[1]
    gy = prior[2]
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
            if abs(z[i] - h - gx * dx - gy * dy) >= gate + widening * (gates[i] - gate):
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
        c00 = a11 * a22 - a12 * a12
        c01 = a02 * a12 - a01 * a22
        c02 = a01 * a12 - a02 * a11
        c11 = a00 * a22 - a02 * a02
        c12 = a01 * a02 - a00 * a12
        c22 = a00 * a11 - a01 * a01
        determinant = a00 * c00 + a01 * c01 + a02 * c02
        h = (c00 * r0 + c01 * r1 + c02 * r2) / determinant
        gx = (c01 * r0 + c11 * r1 + c12 * r2) / determinant
        gy = (c02 * r0 + c12 * r1 + c22 * r2) / determinant
    count = 0
    predicted = 0
    squares = 0.0
    spread = 0.0
    for m in range(members.shape[0]):
        i = members[m]
        dx = x[i] - cx
        dy = y[i] - cy
        gap = z[i] - h - gx * dx - gy * dy
        if abs(gap) < gate:
            count += 1
            squares += gap * gap
            spread += dx * dx + dy * dy
            if abs(z[i] - prior[0] - prior[1] * dx - prior[2] * dy) < gate:
                predicted += 1
    if count == 0:
        return 0, 0, 0.0
    fitted[0] = h
    fitted[1] = gx
    fitted[2] = gy
    # The points of a disc spread to sqrt(2) times their mean radius.
    fitted[5] = math.sqrt(2.0 * spread / count)
    return count, predicted, math.sqrt(squares / count)


@kernel
def predict_patch(
    p: int, patches: Matrix, accepted: Mask, patch_sectors: int, rings: int, prior: Vector
) -> bool:
    """Predict the plane of a patch from the accepted ones around it; False if there are none.

    Those of the next sectors and of two rings inwards and outwards count, in inverse proportion
    to their squared distances. The prediction is written to `prior`, at the patch's centre.
    """
    x = patches[p, 3]
    y = patches[p, 4]
    weights = h = gx = gy = 0.0
    for across in range(-1, 2):
        for ring in range(max(p % rings - 2, 0), min(p % rings + 3, rings)):
            q = ((p // rings + across) % patch_sectors) * rings + ring
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
    prior[0] = h / weights
    prior[1] = gx / weights
    prior[2] = gy / weights
    prior[3] = x
    prior[4] = y
    return True


@kernel
def widen_gates(
    p: int,
    members: Labels,
    x: Vector,
    y: Vector,
    patches: Matrix,
    accepted: Mask,
    patch_sectors: int,
    rings: int,
    gate: float,
    gate_slope: float,
    gates: Vector,
) -> None:
    """Set how far each member may lie from a prediction: more, the farther from known ground."""
    for m in range(members.shape[0]):
        i = members[m]
        nearest = math.inf
        for across in range(-1, 2):
            for ring in range(max(p % rings - 2, 0), min(p % rings + 3, rings)):
                q = ((p // rings + across) % patch_sectors) * rings + ring
                if accepted[q]:
                    dx = x[i] - patches[q, 3]
                    dy = y[i] - patches[q, 4]
                    nearest = min(nearest, math.sqrt(dx * dx + dy * dy) - patches[q, 5])
        gates[i] = gate + gate_slope * max(nearest, 0.0)


@kernel
def is_sunken(
    p: int,
    members: Labels,
    z: Vector,
    patches: Matrix,
    accepted: Mask,
    patch_sectors: int,
    rings: int,
    gate: float,
    prior: Vector,
) -> bool:
    """Tell whether a patch may be ground at a lower level than the next accepted one inwards.

    It must lie lower by more than `gate`, and by less than the distance between the two. Its
    mean height is written to `prior`.
    """
    mean = 0.0
    for m in range(members.shape[0]):
        mean += z[members[m]] / members.shape[0]
    prior[0] = mean
    prior[1] = 0.0
    prior[2] = 0.0
    prior[3] = patches[p, 3]
    prior[4] = patches[p, 4]
    for ring in range(p % rings - 1, -1, -1):
        for across in (0, -1, 1):
            q = ((p // rings + across) % patch_sectors) * rings + ring
            if accepted[q]:
                dx = patches[p, 3] - patches[q, 3]
                dy = patches[p, 4] - patches[q, 4]
                drop = patches[q, 0] - mean
                return drop > gate and drop < math.sqrt(dx * dx + dy * dy)
    return False


@kernel
def is_plane(count: int, predicted: int, members: int, occupied: int, roughness: float) -> bool:
    """Tell whether `count` of the members of a patch make its plane; see `grow_patches`.

    `predicted` of them lie on the predicted plane too; `roughness` is relative to what is allowed.
    """
    if count < 2 or 2 * count < members or roughness > 1.0:
        return False
    return 2 * predicted >= count or (count >= 6 and count >= 0.6 * occupied and roughness <= 0.7)


@kernel
def mark_around(p: int, patch_sectors: int, rings: int, marks: Mask) -> None:
    """Mark the patches that are predicted from one, see `predict_patch`."""
    for across in range(-1, 2):
        sector = (p // rings + across) % patch_sectors
        for ring in range(max(p % rings - 2, 0), min(p % rings + 3, rings)):
            marks[sector * rings + ring] = True


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
    gate: float,
    gate_slope: float,
    prior_weight: float,
    slope_weight: float,
    roughness: float,
) -> tuple[Matrix, Mask]:
    """Grow the coarse ground from the patches in `start`; return (patches, accepted).

    Patch p has the low points ``members[first[p]:first[p + 1]]``, of `occupied[p]` cells in all.
    It joins when at least half of its low points and two of them lie within `gate` of a plane
    near the one its neighbours predict, rough to `roughness` at most. To leave the prediction it
    needs more: six points, in six tenths of its cells, rough to seven tenths of that. When
    growth ends, flat patches that lie lower than the next ground inwards join, and growth goes
    on: beyond an edge the ground may go on at a lower level, and nothing lies beneath it.
    """
    patch_count = first.shape[0] - 1
    patches = np.zeros((patch_count, 6), np.float64)
    for p in range(patch_count):
        for i in members[first[p] : first[p + 1]]:
            patches[p, 3] += x[i]
            patches[p, 4] += y[i]
        patches[p, 3] /= max(first[p + 1] - first[p], 1)
        patches[p, 4] /= max(first[p + 1] - first[p], 1)
    accepted = np.zeros(patch_count, np.bool_)
    joining = np.zeros(patch_count, np.bool_)
    gates = np.full(x.shape[0], gate, np.float64)
    prior = np.zeros(6, np.float64)
    fitted = np.zeros(6, np.float64)
    # A patch that did not join waits until one that predicts it has joined.
    due = np.ones(patch_count, np.bool_)
    sweep = 0
    sinking = False
    while True:
        joined = 0
        for p in range(patch_count):
            n = first[p + 1] - first[p]
            if accepted[p] or n < 2 or not (due[p] or sinking):
                continue
            due[p] = False
            own = members[first[p] : first[p + 1]]
            weight = prior_weight
            if sweep == 0:
                if not start[p]:
                    continue
                for c in range(6):
                    prior[c] = patches[p, c]
            elif sinking:
                if n < 6 or not is_sunken(
                    p, own, z, patches, accepted, patch_sectors, rings, gate, prior
                ):
                    continue
                # No prediction: all of its points are near, and its own mean hardly counts.
                for m in range(n):
                    gates[own[m]] = 1e9
                weight = 1e-3
            elif predict_patch(p, patches, accepted, patch_sectors, rings, prior):
                widen_gates(
                    p, own, x, y, patches, accepted, patch_sectors, rings, gate, gate_slope, gates
                )
            else:
                continue
            count, predicted, rms = fit_patch(
                own, x, y, z, gates, gate, prior, weight, slope_weight, fitted
            )
            if not is_plane(count, predicted, n, occupied[p], rms / roughness):
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
                mark_around(p, patch_sectors, rings, due)
        if joined == 0 and sinking:
            return patches, accepted
        # Lower levels are looked for each time growth along the ground has ended.
        sinking = joined == 0 and sweep > 0
        sweep += 1
