"""Nearest neighbours from all distances."""

import numpy as np


def distances(points, queries):
    """(m, n) distance of every query to every point."""
    return np.linalg.norm(queries[:, None] - points[None], axis=2)


def nearest(points, queries, max_distance=np.inf):
    """Row of and distance to the nearest point nearer than `max_distance`; else -1 and Inf."""
    every = distances(points, queries)
    rows, minimum = np.argmin(every, axis=1), every.min(axis=1)
    is_near = minimum < max_distance
    return np.where(is_near, rows, -1), np.where(is_near, minimum, np.inf)
