import itertools

import numpy as np
import pytest

from reference.hilly_ground import GRID, low_points, sector_starts
from scanlock.arrays import read_only
from scanlock.kernels.ground import model


@pytest.mark.parametrize("seed", range(3))
def test_members_of_patches_match_the_definition(seed):
    rng = np.random.default_rng(seed)
    _, cells, low = low_points(seed)
    ranges = np.hypot(*low[:, :2].T)
    patch, rings = model.prototype_patches(read_only(ranges), sector_starts(cells), 8, 2.0, 1.3)
    ring = np.floor(np.log(np.maximum(ranges / 2, 1)) / np.log(1.3)).astype(int)
    assert rings == ring.max() + 1
    assert (patch == cells // GRID.bins * 8 // GRID.sectors * rings + ring).all()

    chosen, on_plane = rng.random(len(low)) < 0.7, rng.random(len(low)) < 0.6
    members, first, occupied, start = model.patch_members(
        read_only(patch), 8 * rings, read_only(chosen), read_only(on_plane), 0.6, 3
    )
    for p in range(8 * rings):
        own = np.flatnonzero(chosen & (patch == p))
        assert members[first[p] : first[p + 1]].tolist() == own.tolist()
        assert occupied[p] == (patch == p).sum()
        assert start[p] == (on_plane[own].sum() >= max(0.6 * len(own), 3))
    assert 0 < start.sum() < len(start)


def test_seeds_are_on_the_envelope_and_near_the_base():
    rng = np.random.default_rng(3)
    heights, base = rng.uniform(-0.5, 0.5, (2, 300))
    base[::7] = np.nan
    ranges = rng.uniform(0, 60, 300)
    sharp, on_envelope = rng.random((2, 300)) < 0.6
    columns = [read_only(array) for array in (heights, base, ranges, sharp, on_envelope)]
    above, seeds, max_residuals = model.select_seeds(*columns, 0.3, 50.0, 0.15)
    assert np.array_equal(above, heights - base, equal_nan=True)
    assert max_residuals.tolist() == np.where(sharp, np.inf, 0.15).tolist()
    near = np.abs(above) < np.where(sharp, 0.3, 0.15)
    assert seeds.tolist() == (near & on_envelope & (ranges < 50)).tolist()
    assert 0 < seeds.sum() < 300


def test_knots_join_the_prototypes_of_each_sector():
    cells = read_only(np.array([0, 2, 3, 8, 9, 11]))
    starts = read_only(np.array([0, 3, 3, 6]))
    ranges = read_only(np.array([0.5, 2.5, 3.5, 0.5, 0.5001, 3.0]))
    modelled = read_only(np.array([0.0, 1.0, np.nan, 2.0, 2.1, 1.1]))
    sharp = read_only(np.array([True, True, False, False, True, True]))
    knots = model.knots_between_prototypes(
        ranges, modelled, cells, starts, sharp, 12, 1e-3, 0.25, 0.15
    )
    slopes = [(0, 0.5), (0.5, 0), (0, 0), (0, 100), (100, -1 / 2.4999), (-1 / 2.4999, 0)]
    expected = np.full((12, 5), np.nan)
    expected[cells] = np.column_stack(
        [ranges, modelled, np.array(slopes), np.where(sharp, 0.25, 0.15)]
    )
    assert np.allclose(knots, expected, rtol=1e-12, equal_nan=True)


@pytest.mark.parametrize("seed", range(3))
def test_the_extent_of_selected_points_matches_the_definition(seed):
    _, cells, low = low_points(seed)
    low = low * [1.0, 0.1, 1.0] @ np.linalg.qr(np.diag([1, 1, 0]) + 0.3)[0]
    starts = sector_starts(cells)
    chosen = (np.arange(len(low)) % 5 == 0) & (np.arange(len(low)) > starts[4])
    count, breadth, sectors = model.extent(read_only(low), read_only(chosen), starts)
    assert count == chosen.sum()
    covariance = np.cov(low[chosen, :2].T, bias=True)
    assert breadth == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance)[0]))
    assert sectors == sum(chosen[a:b].any() for a, b in itertools.pairwise(starts))
    nothing = read_only(np.zeros(len(low), dtype=bool))
    assert model.extent(read_only(low), nothing, starts) == (0, 0.0, 0)
