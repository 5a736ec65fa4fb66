from itertools import pairwise

import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.kernels.reach import targets_in_reach


def _lists(target, places, widths, skins, end):
    rows = np.zeros((len(target), 11))
    rows[:, :3], rows[:, 9] = target.means, target.widths
    arrays = (read_only(np.asarray(one, float)) for one in (places, widths, skins))
    starts, members = targets_in_reach(read_only(rows), *arrays, end)
    assert starts[0] == 0
    assert starts[-1] == len(members)
    return [members[a:b].tolist() for a, b in pairwise(starts)]


@pytest.mark.parametrize("skin", [0.0, 0.7])
@pytest.mark.parametrize("spread", [0.0, 6.0, 500.0])
@pytest.mark.parametrize("seed", range(3))
def test_all_in_reach_are_listed_once_and_little_else(seed, spread, skin):
    rng = np.random.default_rng(seed)
    target, source = (gaussians(rng, 70, spread=spread, least=0.1, most=2.0) for _ in range(2))
    skins = skin * rng.uniform(0.0, 1.0, 70)
    lists = _lists(target, source.means, source.widths, skins, 9.0)
    gaps, reaches = reference.gaps_and_reaches(target, source, 9.0)
    for i, members in enumerate(lists):
        assert len(members) == len(set(members))
        assert set(np.flatnonzero(gaps[i] < reaches[i] + skins[i])) <= set(members)
        # Without a root the sum of reach and skin is overstated, by the skin at most.
        assert set(members) <= set(np.flatnonzero(gaps[i] <= reaches[i] + 3.0 * skins[i] + 1e-6))
    if spread == 6.0:
        assert 0 < sum(map(len, lists)) < 0.7 * 70 * 70


def test_places_far_outside_reach_nothing():
    target = gaussians(np.random.default_rng(5), 10, spread=5.0)
    places = [[1e4, 0.0, 0.0], [0.0, -1e12, 0.0], [-1e9, 1e9, 0.0], [0.0, 0.0, 1e5]]
    assert _lists(target, places, np.ones(4), np.zeros(4), 25.0) == [[]] * 4


def test_lists_longer_than_expected_grow():
    target = gaussians(np.random.default_rng(6), 200, spread=0.1)
    lists = _lists(target, np.zeros((50, 3)), np.ones(50), np.zeros(50), 1e4)
    assert [sorted(members) for members in lists] == [list(range(200))] * 50
