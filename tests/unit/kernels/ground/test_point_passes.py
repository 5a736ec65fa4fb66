import numpy as np
import pytest

from reference import ground as slow
from reference.hilly_ground import GRID, hills
from scanlock.arrays import read_only
from scanlock.kernels.ground import point_passes


@pytest.mark.parametrize("seed", range(3))
def test_lowest_points_and_counts_match_the_definition(seed):
    points = np.array(hills(seed, count=800))
    points[::3, 2] = np.round(points[::3, 2], 1)
    points = read_only(np.vstack([points, points[:50]]))
    cells = GRID.cells(points)
    count = GRID.sectors * GRID.bins
    expected, filled = slow.lowest_points(points, cells, count)
    for min_points in (4, 1):
        lowest = point_passes.lowest_points(points, cells, count, min_points)
        occupied = lowest >= 0
        assert 0 < occupied.sum() < count
        assert (occupied == (filled >= min_points)).all()
        assert (points[lowest[occupied]] == points[expected[occupied]]).all()

    low, ranges, own, starts = point_passes.gather_prototypes(
        points, read_only(lowest), GRID.sectors
    )
    assert (own == np.flatnonzero(lowest >= 0)).all()
    assert (low == points[lowest[own]]).all()
    assert np.allclose(ranges, np.hypot(*low[:, :2].T), rtol=1e-15)
    assert (starts == np.searchsorted(own, np.arange(GRID.sectors + 1) * GRID.bins)).all()

    plane = read_only(np.array([0.05, -0.02, 0.99, 1.0]))
    near = read_only(np.random.default_rng(seed).uniform(0.1, 0.5, GRID.bins))
    found = point_passes.sharp_prototypes(
        points, cells, read_only(low), read_only(own), plane, near, 3.0, 0.6
    )
    wide = np.tile(near, GRID.sectors)
    close, within = slow.low_counts(points, cells, lowest, plane, wide, 3.0)
    assert (found == (close > 0.6 * within)[own]).all()
    assert 0 < found.sum() < len(found)


def test_heights_above_the_lines_through_knots_match_the_definition():
    rng = np.random.default_rng(1)
    points = hills(1, 500)
    cells = GRID.cells(points)
    knots = rng.uniform(-1, 1, (GRID.sectors * GRID.bins, 5))
    knots[:, 0] = rng.uniform(0, 30, len(knots))
    knots[::5, 1] = np.nan
    knots[:, 4] = rng.uniform(0.1, 0.6, len(knots))
    plane = np.array([0.1, 0.0, 0.9, -0.4])
    height, is_ground, is_below, near, close = point_passes.classify_points(
        points, cells, read_only(plane), read_only(knots), 0.5
    )
    for point, cell, found in zip(points, cells, height, strict=True):
        if cell < 0 or np.isnan(knots[cell, 1]):
            assert np.isnan(found)
            continue
        step = np.hypot(*point[:2]) - knots[cell, 0]
        ground = knots[cell, 1] + step * (knots[cell, 2] if step < 0 else knots[cell, 3])
        assert found == pytest.approx(plane[:3] @ point + plane[3] - ground, abs=1e-12)
    thresholds = np.minimum(0.5, knots[cells, 4])
    assert is_ground.tolist() == (np.abs(height) < thresholds).tolist()
    assert is_below.tolist() == (height <= -0.5).tolist()
    assert (near, close) == ((np.abs(height) < 1.5).sum(), (np.abs(height) < 0.5).sum())
    assert 0 < is_ground.sum() < close < near


def test_rotated_points_match_the_definition():
    points = hills(0, 50)
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    rotated = point_passes.rotated_points(points, read_only(rotation))
    assert np.allclose(rotated, points @ rotation.T)
