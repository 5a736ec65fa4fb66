from itertools import pairwise

import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.p2d import p2d_terms
from scanlock.kernels.tiles import tile_lists


def _tiles(means, radii, corner, width, columns, rows):
    return tile_lists(read_only(means), read_only(radii), read_only(corner), width, columns, rows)


@pytest.mark.parametrize("seed", range(4))
def test_tiles_list_the_discs_that_reach_them(seed):
    rng = np.random.default_rng(seed)
    means = rng.uniform(-20.0, 20.0, (30, 3))
    radii = rng.uniform(0.1, 4.0, 30)
    corner = np.array([-15.0, -9.0])
    starts, members = _tiles(means, radii, corner, 2.5, 9, 7)
    lists = [members[a:b].tolist() for a, b in pairwise(starts)]
    assert lists == reference.tile_members(means, radii, corner, 2.5, 9, 7)
    assert any(lists)
    assert not all(lists)


def test_a_disc_on_an_edge_is_listed_on_both_sides():
    means = np.array([[3.0, 3.0, 0.0]])
    starts, members = _tiles(means, np.array([0.5]), np.zeros(2), 3.0, 2, 2)
    np.testing.assert_array_equal(starts, [0, 1, 2, 3, 4])
    np.testing.assert_array_equal(members, 0)


def test_terms_from_lists_match_the_sum_over_all_pairs():
    rng = np.random.default_rng(9)
    target = gaussians(rng, 20, spread=6.0)
    points = rng.uniform(-12.0, 12.0, (300, 3))
    pose = Pose.from_step(rng.normal(size=6))
    radii = np.sqrt(25.0 * target.widths)
    low = (target.means[:, :2] - radii[:, None]).min(axis=0)
    columns, rows = np.ceil(((target.means[:, :2] + radii[:, None]).max(axis=0) - low) / 2.0)
    grid = (read_only(low), 2.0, int(columns), int(rows))
    lists = _tiles(target.means, radii, *grid)
    terms = p2d_terms(
        read_only(points),
        target.means,
        target.packed_precisions,
        *lists,
        *grid,
        pose.rotation,
        pose.translation,
        1.0,
        16.0,
        25.0,
        1.0,
    )
    expected = 300 * reference.p2d_value(pose, target, points)
    np.testing.assert_allclose(terms[0], expected, rtol=1e-11)


def test_a_point_outside_all_tiles_meets_nothing():
    rng = np.random.default_rng(10)
    target = gaussians(rng, 3, spread=1.0)
    lists = _tiles(target.means, np.full(3, 50.0), np.zeros(2), 1.0, 2, 2)
    outside = np.array([[-1e-9, 1.0, 0.0], [1.0, 2.0, 0.0], [np.nextafter(2.0, 3.0), 1.0, 0.0]])
    terms = p2d_terms(
        read_only(outside),
        target.means,
        target.packed_precisions,
        *lists,
        read_only(np.zeros(2)),
        1.0,
        2,
        2,
        Pose.identity().rotation,
        Pose.identity().translation,
        1.0,
        16.0,
        25.0,
        1.0,
    )
    np.testing.assert_array_equal(terms, np.zeros(28))


def test_the_convex_part_is_that_of_gauss_and_newton():
    rng = np.random.default_rng(11)
    target = gaussians(rng, 6, spread=2.0)
    points = rng.uniform(-3.0, 3.0, (40, 3))
    pose = Pose.from_step(0.1 * rng.normal(size=6))
    lists = _tiles(target.means, np.full(6, 50.0), np.full(2, -60.0), 120.0, 1, 1)
    terms = p2d_terms(
        read_only(points), target.means, target.packed_precisions, *lists,
        read_only(np.full(2, -60.0)), 120.0, 1, 1, pose.rotation, pose.translation,
        1.0, 16.0, 25.0, 0.0,
    )  # fmt: skip
    expected = reference.p2d_gauss_newton(pose, target, points)
    np.testing.assert_allclose(terms[7:], expected[np.triu_indices(6)], rtol=1e-9, atol=1e-12)
