"""Numbering of cells and splitting of clusters by their definitions."""

import numpy as np


def numbered(cells):
    """Rank of each cell among the occupied ones, -1 for none, and the occupied cells."""
    occupied = sorted({int(cell) for cell in cells if cell >= 0})
    ranks = {cell: rank for rank, cell in enumerate(occupied)}
    return [ranks.get(int(cell), -1) for cell in cells], occupied


def pieces(points, rows, max_radius):
    """Sets of rows after splits across the longest axis until every set is small."""
    own = points[list(rows)]
    offsets = own - own.mean(axis=0)
    if np.linalg.norm(offsets, axis=1).max() <= max_radius:
        return {frozenset(rows)}
    longest = np.linalg.svd(offsets)[2][0]
    near = [row for row, offset in zip(rows, offsets, strict=True) if offset @ longest < 0]
    far = [row for row, offset in zip(rows, offsets, strict=True) if offset @ longest >= 0]
    return pieces(points, near, max_radius) | pieces(points, far, max_radius)


def partition(labels):
    """Sets of the rows with each label; -1 is no label."""
    labels = np.asarray(labels)
    return {
        frozenset(np.flatnonzero(labels == label).tolist()) for label in set(labels[labels >= 0])
    }
