import numpy as np
import pytest

from scanlock.arrays import read_only
from scanlock.geometry.rotations import exp_rotation
from scanlock.kernels.search.ground_overlap import ground_differences, plane_sums


def _grid(rng, side, empty_ratio=0.3):
    grid = rng.normal(0.0, 0.5, (side, side))
    grid[rng.uniform(size=grid.shape) < empty_ratio] = np.nan
    return read_only(grid)


def _differences(rng, shift):
    target, source = _grid(rng, 12), _grid(rng, 8)
    rotation = read_only(exp_rotation(np.array([0.05, -0.1, 2.0])))
    return target, source, rotation, ground_differences(target, 2.0, source, 1.5, rotation, shift)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (3.0, -4.0, 1.0), (14.0, 9.0, 0.0)])
def test_height_differences_match_the_definition(shift):
    shift = read_only(np.array(shift))
    target, source, rotation, differences = _differences(np.random.default_rng(0), shift)
    overlapping = 0
    for cell, (x, y, difference) in enumerate(differences.T):
        i, j = divmod(cell, 8)
        if np.isnan(source[i, j]):
            assert np.isnan(difference)
            continue
        point = rotation @ [(i - 3.5) * 1.5, (j - 3.5) * 1.5, source[i, j]]
        row, column = (int(at) for at in np.floor((point + shift)[:2] // 2.0) + 6)
        is_inside = 0 <= row < 12 and 0 <= column < 12
        if not is_inside or np.isnan(target[row, column]):
            assert np.isnan(difference)
            continue
        overlapping += 1
        np.testing.assert_allclose((x, y), point[:2], atol=1e-12)
        np.testing.assert_allclose(difference, target[row, column] - (point + shift)[2], atol=1e-12)
    assert 0 < overlapping < 64


@pytest.mark.parametrize("scale", [0.3, np.inf])
def test_sums_match_the_definition(scale):
    differences = read_only(_differences(np.random.default_rng(1), read_only(np.zeros(3)))[-1])
    x, y, difference = differences[:, ~np.isnan(differences[2])]
    columns = np.stack([np.ones_like(x), x, y])
    rows = np.triu_indices(3)
    plain, weighted = plane_sums(differences, scale)
    np.testing.assert_allclose(plain, (columns @ columns.T)[rows], rtol=1e-12)
    own = columns / (1.0 + (difference / scale) ** 2) ** 2
    expected = np.concatenate([(own @ columns.T)[rows], own @ difference])
    np.testing.assert_allclose(weighted, expected, rtol=1e-11)
