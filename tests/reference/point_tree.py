"""Nearest points by all distances."""

import numpy as np


def distances(points, queries):
    """(m, n) distance of every query to every point."""
    return np.linalg.norm(queries[:, None] - points[None], axis=2)


def nearest(points, queries, limit=np.inf):
    """Row of and distance to the nearest point; -1 and Inf where none is nearer than `limit`."""
    every = distances(points, queries)
    rows, least = np.argmin(every, axis=1), every.min(axis=1)
    return np.where(least < limit, rows, -1), np.where(least < limit, least, np.inf)
