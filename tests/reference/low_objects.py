"""Low objects and occupied columns by definition, one point and one voxel at a time."""

import itertools
import math

import numpy as np


def low_voxels(points, heights, rotation, ranges, min_height, voxel_size, layers, min_points):
    """Points of each voxel of low objects, by column along x and y and by layer."""
    low_layers, all_layers = layers
    by_voxel = {}
    for point, height in zip(points, heights, strict=True):
        in_range = ranges[0] <= np.linalg.norm(point) < ranges[1]
        if in_range and min_height <= height < min_height + all_layers * voxel_size:
            x, y, _ = rotation @ point
            layer = int((height - min_height) / voxel_size)
            cell = (math.floor(x / voxel_size), math.floor(y / voxel_size), layer)
            by_voxel.setdefault(cell, []).append(point)
    kept = {cell: found for cell, found in by_voxel.items() if len(found) >= min_points}
    structure = {(i // 2, j // 2) for i, j, layer in kept if layer >= low_layers}
    return {
        (i, j, layer): np.mean(found, axis=0)
        for (i, j, layer), found in kept.items()
        if layer < low_layers and (i // 2, j // 2) not in structure
    }


def joined(voxels):
    """Sets of rows of voxels that are connected through neighbours."""
    groups = [{row} for row in range(len(voxels))]
    for a, b in itertools.combinations(range(len(voxels)), 2):
        if np.abs(voxels[a] - voxels[b]).max() <= 1:
            one, other = (next(group for group in groups if row in group) for row in (a, b))
            if one is not other:
                groups.remove(other)
                one |= other
    return {frozenset(group) for group in groups}


def occupied_bins(points, rotation, base, cell, side):
    """Column along x and y, and height bin, of each point within the columns."""
    level = points @ rotation.T - [0.0, 0.0, base]
    bins = np.floor(level / cell).astype(int) + np.array([side // 2, side // 2, 0])
    inside = ((bins >= 0) & (bins < [side, side, 64])).all(axis=1)
    return {tuple(map(int, one)) for one in bins[inside]}


def is_near(bins, rotation, base, cell, side, reach, point):
    """Whether the centre of an occupied bin is within reach."""
    offset = np.array([0.5 - side // 2, 0.5 - side // 2, 0.5])
    centres = (np.array(sorted(bins)) + offset) * cell + [0.0, 0.0, base]
    return bool((np.linalg.norm(centres - rotation @ point, axis=1) <= reach).any())
