import numpy as np
import pytest

from reference import ground as slow
from reference.hilly_ground import GRID, low_points, sector_starts
from scanlock.arrays import read_only
from scanlock.kernels.ground import point_passes
from scanlock.kernels.ground.envelope import lower_envelope


@pytest.mark.parametrize("seed", range(3))
def test_the_lower_envelope_matches_the_definition(seed):
    (x, y, z), cells, _ = low_points(seed)
    found = lower_envelope(x, y, z, cells, sector_starts(cells), GRID.bins, 0.6, 0.1, 3)
    exact = slow.lower_envelope(x, y, z, cells, GRID.sectors, GRID.bins, 0.6, 0.1, 3)
    # Cones are passed on from cell to cell: one may be lost, none is added.
    assert (found >= exact - 1e-12).all()
    assert np.mean(found > exact + 1e-9) < 0.03


@pytest.mark.parametrize(("count", "is_lower"), [(1, False), (3, False), (60, True)])
def test_only_a_lower_level_and_not_a_few_reflections_lowers_the_envelope(count, is_lower):
    rng = np.random.default_rng(0)
    azimuth, radius = rng.uniform(-np.pi, np.pi, 4000), rng.uniform(1, 29, 4000)
    points = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), 0 * radius])
    nearest = np.argsort(np.linalg.norm(points - [15, 3, 0], axis=1))
    points[nearest[:count], 2] = -4.0
    cells = GRID.cells(points)
    lowest = point_passes.lowest_points(read_only(points), cells, GRID.sectors * GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    x, y, z = (read_only(column) for column in points[lowest[own]].T)
    above = z - lower_envelope(x, y, z, read_only(own), sector_starts(own), GRID.bins, 0.6, 0.1, 3)
    assert ((above > 0.25).sum() > 20) == is_lower
