"""Loops of ground segmentation by their definitions."""

import math

import numpy as np


def lowest_points(points, cells, count):
    """Row of the lowest point of each cell; ties by smallest range, then x, then y."""
    rows = []
    for c in range(count):
        own = np.flatnonzero(cells == c)
        keys = [(points[i, 2], points[i, 0] ** 2 + points[i, 1] ** 2, *points[i, :2]) for i in own]
        rows.append(own[min(range(len(own)), key=keys.__getitem__)] if len(own) else -1)
    return np.array(rows), np.array([(cells == c).sum() for c in range(count)])


def low_counts(points, cells, lowest, plane, near, factor):
    """Numbers of points of each cell less than near and factor * near above its lowest."""
    heights = points @ plane[:3] + plane[3]
    close, within = [], []
    for c, row in enumerate(lowest):
        rise = heights[cells == c] - (heights[row] if row >= 0 else 0.0)
        close.append((rise < near[c]).sum())
        within.append((rise < factor * near[c]).sum())
    return np.array(close), np.array(within)


def supporters(x, y, z, cells, sectors, bins, slope, slack):
    """Number of low points in the 5 x 5 cells around each that are at most a little higher."""
    sector, ring = np.divmod(cells, bins)
    across = np.abs(np.subtract.outer(sector, sector))
    around = np.minimum(across, sectors - across) <= 2
    near = around & (np.abs(np.subtract.outer(ring, ring)) <= 2)
    np.fill_diagonal(near, False)
    flat = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
    return (near & (z[None, :] < z[:, None] + slack + slope * flat)).sum(axis=1)


def lower_envelope(x, y, z, cells, sectors, bins, max_slope, slack, support):
    """Height at each low point of the lowest of the cones above all supported low points."""
    feet = supporters(x, y, z, cells, sectors, bins, max_slope / 2, slack) >= support
    flat = np.hypot(np.subtract.outer(x, x), np.subtract.outer(y, y))
    return (z + max_slope * flat)[:, feet].min(axis=1, initial=math.inf)


def plane_score(points, weights, thresholds, normal, offset):
    """Weighted fraction of the points on a plane, less half of those two thresholds below it."""
    h = (points @ normal + offset) / thresholds
    return float(np.where(np.abs(h) < 1, weights * (1 - h**2), -0.5 * weights * (h < -2)).sum())


def scored_triple(points, weights, thresholds, triple, scored):
    """Plane through three points, the side of the higher score up, and its score."""
    a, b, c = points[triple]
    up = np.cross(b - a, c - a)
    up /= np.linalg.norm(up)
    first = [one[:scored] for one in (points, weights, thresholds)]
    sides = [(*side, -side @ a, plane_score(*first, side, -side @ a)) for side in (up, -up)]
    return max(sides, key=lambda side: side[4])


def biweight_plane(points, weights, thresholds, factor, normal, offset):
    """Normal and offset of the weighted least-squares plane of the points near a plane."""
    h = (points @ normal + offset) / (factor * thresholds)
    w = weights * np.where(np.abs(h) < 1, (1 - h**2) ** 2, 0.0) / thresholds**2
    mean = w @ points / w.sum()
    _, _, axes = np.linalg.svd(np.sqrt(w)[:, None] * (points - mean))
    up = axes[2] * np.sign(axes[2, 2])
    return up, -float(up @ mean)


def ridge_plane(points, prior, prior_weight, slope_weight):
    """(h, gx, gy) at the centre of `prior` by least squares, with the prior as additional rows."""
    d = points[:, :2] - prior[3:5]
    rows = np.vstack([
        np.column_stack([np.ones(len(d)), d]),
        np.diag(np.sqrt([prior_weight, slope_weight, slope_weight])),
    ])  # fmt: skip
    values = np.concatenate([points[:, 2], rows[len(d) :] @ prior[:3]])
    return np.linalg.lstsq(rows, values, rcond=None)[0]


def fit_patch(points, thresholds, threshold, prior, prior_weight, slope_weight):
    """Three iterations of the ridge plane: (inliers, predicted inliers, rms, plane, radius)."""
    d = points[:, :2] - prior[3:5]
    design = np.column_stack([np.ones(len(d)), d])
    plane = prior[:3]
    for widening in (1.0, 0.5, 0.0):
        near = np.abs(points[:, 2] - design @ plane) < threshold + widening * (
            thresholds - threshold
        )
        plane = ridge_plane(points[near], prior, prior_weight, slope_weight)
    residual = points[:, 2] - design @ plane
    on = np.abs(residual) < threshold
    if not on.any():
        return 0, 0, 0.0, None, None
    predicted = on & (np.abs(points[:, 2] - design @ prior[:3]) < threshold)
    radius = math.sqrt(2 * (d[on] ** 2).sum(axis=1).mean())
    return int(on.sum()), int(predicted.sum()), math.sqrt((residual[on] ** 2).mean()), plane, radius


def neighbours(p, sectors, rings, max_rings):
    """Patches in the sectors next to that of p, at most `max_rings` rings away."""
    sector, ring = divmod(p, rings)
    inner, outer = max(ring - max_rings, 0), min(ring + max_rings, rings - 1)
    return [
        (sector + across) % sectors * rings + k
        for across in (-1, 0, 1)
        for k in range(inner, outer + 1)
    ]


def prediction(p, patches, accepted, sectors, rings):
    """Plane predicted at the centre of p by the accepted patches around it, or None."""
    around = [q for q in neighbours(p, sectors, rings, 2) if accepted[q]]
    if not around:
        return None
    d = patches[p, 3:5] - patches[around, 3:5]
    w = 1 / (0.01 + (d**2).sum(axis=1))
    heights = patches[around, 0] + (patches[around, 1:3] * d).sum(axis=1)
    return np.array(
        [w @ heights / w.sum(), *(w @ patches[around, 1:3] / w.sum()), *patches[p, 3:5], 0.0]
    )


def base_height(point, own, patches, accepted, sectors, rings):
    """Weighted mean of the planes of the accepted patches around a point; NaN for none."""
    around = [q for q in neighbours(own, sectors, rings, 1) if accepted[q]]
    if not around:
        return math.nan
    d = point[:2] - patches[around, 3:5]
    w = 1 / (0.1 + (d**2).sum(axis=1)) ** 2 * np.where(np.array(around) == own, 4, 1)
    return float(w @ (patches[around, 0] + (patches[around, 1:3] * d).sum(axis=1)) / w.sum())


def grown_patches(
    points, members, start, occupied, sectors, rings, threshold, threshold_slope, prior_weight,
    slope_weight, roughness,
):  # fmt: skip
    """Coarse ground by sweeps over all patches until none joins, alternating with lower levels.

    `members` are the rows of the low points of each patch.
    """
    patches = np.zeros((sectors * rings, 6))
    for p, own in enumerate(members):
        if len(own):
            patches[p, 3:5] = points[own, :2].mean(axis=0)
    accepted = np.zeros(len(patches), dtype=bool)
    sweep, sinking = 0, False
    while True:
        joined = {}
        for p, own in enumerate(members):
            if accepted[p] or len(own) < 2:
                continue
            case = _case(p, points[own], patches, accepted, start[p], sectors, rings,
                         sweep, sinking, threshold, threshold_slope)  # fmt: skip
            if case is None:
                continue
            prior, thresholds = case
            weight = 1e-3 if sinking else prior_weight
            count, predicted, rms, plane, radius = fit_patch(
                points[own], thresholds, threshold, prior, weight, slope_weight
            )
            many = count >= 2 and count >= len(own) / 2 and rms <= roughness
            firm = count >= 6 and count >= 0.6 * occupied[p] and rms <= 0.7 * roughness
            if many and (predicted >= count / 2 or firm):
                joined[p] = [*plane, *patches[p, 3:5], radius]
        for p, row in joined.items():
            patches[p] = row
            accepted[p] = True
        if not joined and sinking:
            return patches, accepted
        sinking = not joined and sweep > 0
        sweep += 1


def _case(
    p, own, patches, accepted, start, sectors, rings, sweep, sinking, threshold, threshold_slope
):
    """Prior and initial thresholds of a patch that may join now, or None."""
    centre = patches[p, 3:5]
    if sweep == 0:
        return (np.array([0, 0, 0, *centre, 0]), np.full(len(own), threshold)) if start else None
    if not sinking:
        prior = prediction(p, patches, accepted, sectors, rings)
        if prior is None:
            return None
        around = [q for q in neighbours(p, sectors, rings, 2) if accepted[q]]
        away = np.linalg.norm(own[:, None, :2] - patches[around, 3:5], axis=2)
        away = np.maximum((away - patches[around, 5]).min(axis=1), 0)
        return prior, threshold + threshold_slope * away
    mean = own[:, 2].mean()
    sector, ring = divmod(p, rings)
    for inner in range(ring - 1, -1, -1):
        for across in (0, -1, 1):
            q = (sector + across) % sectors * rings + inner
            if accepted[q]:
                drop = patches[q, 0] - mean
                near = np.linalg.norm(centre - patches[q, 3:5])
                if len(own) >= 6 and threshold < drop < near:
                    return np.array([mean, 0, 0, *centre, 0]), np.full(len(own), 1e9)
                return None
    return None
