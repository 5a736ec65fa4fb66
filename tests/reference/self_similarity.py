"""Views from above and their correlations by definition, one displacement at a time."""

import numpy as np
from scipy.ndimage import map_coordinates


def view_from_above(columns, half, merged, max_bins):
    """Number of height bins occupied in a square of columns, at most `max_bins`."""
    first, side = len(columns) // 2 - half, 2 * half // merged
    view = np.zeros((side, side))
    for i in range(side):
        for j in range(side):
            rows, cols = (slice(first + merged * one, first + merged * (one + 1)) for one in (i, j))
            bins = {
                b for one in columns[rows, cols].ravel() for b in range(64) if int(one) >> b & 1
            }
            view[i, j] = min(len(bins), max_bins)
    return view


def correlation(view, turn, steps):
    """Sum of products of a view and itself, turned by quarter turns and moved, relative to unmoved.

    A quarter turn takes (x, y) to (-y, x); rows are along x.
    """
    side = len(view)
    turned = np.zeros_like(view)
    for i, j in np.ndindex(view.shape):
        x, y = i - 0.5 * (side - 1), j - 0.5 * (side - 1)
        for _ in range(turn):
            x, y = -y, x
        turned[round(x + 0.5 * (side - 1)), round(y + 0.5 * (side - 1))] = view[i, j]
    padded = np.pad(view, steps)
    found = np.zeros((2 * steps + 1, 2 * steps + 1))
    for i, j in np.ndindex(found.shape):
        found[i, j] = (padded[i : i + side, j : j + side] * turned).sum()
    return found / (view * view).sum()


def common_correlation(target, source, yaw, offset):
    """Smaller one of the correlations of target and source at translations along the target."""
    steps = len(target) // 2
    found = np.zeros(target.shape)
    for i, j in np.ndindex(target.shape):
        x, y = i - steps + offset[0], j - steps + offset[1]
        in_source = [
            [np.cos(yaw) * x + np.sin(yaw) * y + steps],
            [np.cos(yaw) * y - np.sin(yaw) * x + steps],
        ]
        inside = np.min(in_source) >= 0 and np.max(in_source) < len(source) - 1
        turned = map_coordinates(source, in_source, order=1)[0] if inside else 0.0
        found[i, j] = min(target[i, j], turned)
    return found
