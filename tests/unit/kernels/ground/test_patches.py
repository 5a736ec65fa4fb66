import numpy as np
import pytest

from reference import ground as slow
from reference.hilly_ground import GRID, low_points
from scanlock.arrays import read_only
from scanlock.kernels.ground.model import blended_patch_heights
from scanlock.kernels.ground.patches import grow_patches


@pytest.mark.parametrize("seed", range(3))
def test_grown_patches_match_the_definition(seed):
    (x, y, z), cells, low = low_points(seed)
    sectors, rings = 8, 6
    ring = np.minimum((np.hypot(x, y) / 5).astype(int), rings - 1)
    patch = cells // GRID.bins * sectors // GRID.sectors * rings + ring
    used = np.random.default_rng(seed).random(len(z)) < 0.9
    rows = [np.flatnonzero(used & (patch == p)) for p in range(sectors * rings)]
    occupied = np.bincount(patch, minlength=sectors * rings)
    start = np.arange(sectors * rings) % rings == 1
    numbers = (0.3, 0.35, 2.0, 0.9, 0.15)
    patches, accepted = grow_patches(
        x, y, z,
        read_only(np.concatenate(rows).astype(np.int64)),
        read_only(np.concatenate([[0], np.cumsum([len(own) for own in rows])])),
        read_only(occupied), read_only(start), sectors, rings, *numbers,
    )  # fmt: skip
    expected = slow.grown_patches(low, rows, start, occupied, sectors, rings, *numbers)
    assert (accepted == expected[1]).all()
    assert accepted.sum() > 10
    assert np.allclose(patches[accepted], expected[0][accepted], atol=1e-9)

    heights = blended_patch_heights(
        x, y, read_only(patch), read_only(patches), read_only(accepted), sectors, rings
    )
    expected_heights = [
        slow.base_height(point, p, patches, accepted, sectors, rings)
        for point, p in zip(low, patch, strict=True)
    ]
    assert np.allclose(heights, expected_heights, atol=1e-9, equal_nan=True)
