"""Numbering of cells and cutting of parts, set by set, from the definition."""

import numpy as np


def numbered(cells):
    """The rank of each row's cell among the occupied ones, -1 for none, and those cells."""
    occupied = sorted({int(cell) for cell in cells if cell >= 0})
    ranks = {cell: rank for rank, cell in enumerate(occupied)}
    return [ranks.get(int(cell), -1) for cell in cells], occupied


def pieces(points, rows, max_radius):
    """Sets of rows left when a part is halved across its longest axis until it is small."""
    part = points[list(rows)]
    gaps = part - part.mean(axis=0)
    if np.linalg.norm(gaps, axis=1).max() <= max_radius:
        return {frozenset(rows)}
    longest = np.linalg.svd(gaps)[2][0]
    near = [row for row, gap in zip(rows, gaps, strict=True) if gap @ longest < 0]
    far = [row for row, gap in zip(rows, gaps, strict=True) if gap @ longest >= 0]
    return pieces(points, near, max_radius) | pieces(points, far, max_radius)


def partition(labels):
    """The sets of rows under each label, whatever the labels are called; -1 is no part."""
    labels = np.asarray(labels)
    return {
        frozenset(np.flatnonzero(labels == label).tolist()) for label in set(labels[labels >= 0])
    }
