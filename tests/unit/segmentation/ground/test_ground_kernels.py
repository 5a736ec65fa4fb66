"""Kernels of ground segmentation against their definitions."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from reference import ground as slow
from scanlock.arrays import read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels.ground import model as on_model
from scanlock.kernels.ground import point_passes as passes
from scanlock.kernels.ground.envelope import lower_envelope
from scanlock.kernels.ground.model import blended_patch_heights
from scanlock.kernels.ground.patches import grow_patches
from scanlock.kernels.ground.plane import (
    best_sampled_plane,
    plane_moments,
    plane_score,
    refined_plane,
    smallest_eigenvector,
    weighted_columns,
)
from scanlock.segmentation.ground.plane import fit_base_plane

_GRID = PolarGrid(sectors=24, max_range=30.0, first_width=1.0, growth=1.08)


def _hills(seed, count=3000):
    """Points of hilly ground with boxes, reflections below it and points out of range."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-25, 25, (count, 2))
    z = 0.8 * np.sin(xy[:, 0] / 6) + 0.05 * xy[:, 1] + rng.normal(0, 0.03, count)
    z += np.where((xy[:, 0] % 9 < 2) & (xy[:, 1] % 7 < 2), rng.uniform(0, 2, count), 0)
    z[rng.random(count) < 0.003] -= 2.0
    return read_only(np.column_stack([xy, z]))


def _low(seed):
    """Coordinates and cells of the low points of the hills."""
    points = _hills(seed)
    cells = _GRID.cells(points)
    lowest = passes.lowest_points(points, cells, _GRID.sectors * _GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    low = points[lowest[own]]
    return [read_only(column) for column in low.T], read_only(own), low


def _starts(cells):
    """First row of each sector."""
    return read_only(np.searchsorted(cells, np.arange(_GRID.sectors + 1) * _GRID.bins))


@pytest.mark.parametrize("seed", range(3))
def test_lowest_points_and_counts_match_the_definition(seed):
    points = np.array(_hills(seed, count=800))
    points[::3, 2] = np.round(points[::3, 2], 1)
    points = read_only(np.vstack([points, points[:50]]))
    cells = _GRID.cells(points)
    count = _GRID.sectors * _GRID.bins
    expected, filled = slow.lowest_points(points, cells, count)
    for min_points in (4, 1):
        lowest = passes.lowest_points(points, cells, count, min_points)
        occupied = lowest >= 0
        assert 0 < occupied.sum() < count
        assert (occupied == (filled >= min_points)).all()
        assert (points[lowest[occupied]] == points[expected[occupied]]).all()

    low, ranges, own, starts = passes.gather_prototypes(points, read_only(lowest), _GRID.sectors)
    assert (own == np.flatnonzero(lowest >= 0)).all()
    assert (low == points[lowest[own]]).all()
    assert np.allclose(ranges, np.hypot(*low[:, :2].T), rtol=1e-15)
    assert (starts == np.searchsorted(own, np.arange(_GRID.sectors + 1) * _GRID.bins)).all()

    plane = read_only(np.array([0.05, -0.02, 0.99, 1.0]))
    near = read_only(np.random.default_rng(seed).uniform(0.1, 0.5, _GRID.bins))
    found = passes.sharp_prototypes(
        points, cells, read_only(low), read_only(own), plane, near, 3.0, 0.6
    )
    wide = np.tile(near, _GRID.sectors)
    close, within = slow.low_counts(points, cells, lowest, plane, wide, 3.0)
    assert (found == (close > 0.6 * within)[own]).all()
    assert 0 < found.sum() < len(found)


def test_heights_between_knots_are_interpolated_linearly():
    rng = np.random.default_rng(1)
    points = _hills(1, 500)
    cells = _GRID.cells(points)
    knots = rng.uniform(-1, 1, (_GRID.sectors * _GRID.bins, 5))
    knots[:, 0] = rng.uniform(0, 30, len(knots))
    knots[::5, 1] = np.nan
    knots[:, 4] = rng.uniform(0.1, 0.6, len(knots))
    plane = np.array([0.1, 0.0, 0.9, -0.4])
    height, is_ground, is_below, near, close = passes.classify_points(
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
    points = _hills(0, 50)
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    rotated = passes.rotated_points(points, read_only(rotation))
    assert np.allclose(rotated, points @ rotation.T)


@pytest.mark.parametrize("seed", range(3))
def test_the_lower_envelope_matches_the_definition(seed):
    (x, y, z), cells, _ = _low(seed)
    found = lower_envelope(x, y, z, cells, _starts(cells), _GRID.bins, 0.6, 0.1, 3)
    exact = slow.lower_envelope(x, y, z, cells, _GRID.sectors, _GRID.bins, 0.6, 0.1, 3)
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
    cells = _GRID.cells(points)
    lowest = passes.lowest_points(read_only(points), cells, _GRID.sectors * _GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    x, y, z = (read_only(column) for column in points[lowest[own]].T)
    above = z - lower_envelope(x, y, z, read_only(own), _starts(own), _GRID.bins, 0.6, 0.1, 3)
    assert ((above > 0.25).sum() > 20) == is_lower


def test_plane_scores_and_moments_match_the_definition():
    rng = np.random.default_rng(5)
    low = rng.normal(0, 1, (400, 3)) * [10, 10, 0.5]
    weights, thresholds = rng.random(400), rng.uniform(0.2, 0.6, 400)
    normal = np.array([0.1, -0.05, 1.0]) / np.linalg.norm([0.1, -0.05, 1.0])
    columns = [read_only(column) for column in (*low.T, weights, 1 / thresholds)]
    measured = weighted_columns(read_only(low), 10.0, 0.2, 0.02)
    ranges = np.hypot(*low[:, :2].T)
    proximity = 1 / (10 + ranges)
    direct = [*low.T, proximity / proximity.sum(), 1 / (0.2 + 0.02 * ranges)]
    assert np.allclose(measured, direct, rtol=1e-13)
    found = plane_score(*columns, *normal, 0.1)
    assert found == pytest.approx(slow.plane_score(low, weights, thresholds, normal, 0.1))

    sums = plane_moments(*columns, 1.5, *normal, 0.1)
    mean = sums[1:4] / sums[0]
    xx, xy, xz, yy, yz, zz = sums[4:] / sums[0]
    scatter = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - np.outer(mean, mean)
    up = np.linalg.eigh(scatter)[1][:, 0]
    expected, offset = slow.biweight_plane(low, weights, thresholds, 1.5, normal, 0.1)
    assert np.allclose(up * np.sign(up[2]), expected, atol=1e-9)
    assert -(up * np.sign(up[2])) @ mean == pytest.approx(offset)
    once = refined_plane(*columns, read_only(np.array([1.5])), *normal, 0.1)
    assert np.allclose(once[:4], [*expected, offset], atol=1e-9)
    assert once[4] == pytest.approx(slow.plane_score(low, weights, thresholds, expected, offset))
    missed = refined_plane(*columns, read_only(np.array([1.5])), *normal, 90.0)
    assert missed[4] == -np.inf


@given(
    arrays(np.float64, (6, 3), elements=st.floats(-3, 3)),
    st.sampled_from([1.0, 1e-9, 1e9]),
)
def test_the_flattest_direction_is_the_eigenvector_of_the_smallest_eigenvalue(rows, scale):
    scatter = rows.T @ rows * scale
    values, axes = np.linalg.eigh(scatter)
    found = np.array(smallest_eigenvector(scatter.copy()))
    assert np.linalg.norm(found) == pytest.approx(1)
    assert found[2] >= 0
    assert found @ scatter @ found == pytest.approx(values[0], abs=1e-13 * values[2])
    if values[1] - values[0] > 1e-3 * values[2]:
        assert abs(found @ axes[:, 0]) == pytest.approx(1)


def test_the_best_sampled_plane_has_the_most_inliers():
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(-20, 20, (300, 2)), rng.normal(-1.5, 0.02, 300)])
    clutter = np.column_stack([rng.uniform(-20, 20, (600, 2)), rng.uniform(-1.5, 6, 600)])
    plane = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert plane.tilt < 0.01
    assert plane.offset == pytest.approx(1.5, abs=0.03)
    # The result is bitwise reproducible.
    again = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert (plane.coefficients == again.coefficients).all()


def test_points_on_a_line_have_no_plane():
    line = np.column_stack([np.linspace(1, 9, 40), np.zeros(40), np.zeros(40)])
    for low in (np.zeros((0, 3)), np.ones((2, 3)), np.ones((30, 3)), line):
        assert fit_base_plane(low, max_tilt=0.7) is None


@pytest.mark.parametrize("seed", range(3))
def test_grown_patches_match_the_definition(seed):
    (x, y, z), cells, low = _low(seed)
    sectors, rings = 8, 6
    ring = np.minimum((np.hypot(x, y) / 5).astype(int), rings - 1)
    patch = cells // _GRID.bins * sectors // _GRID.sectors * rings + ring
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


@pytest.mark.parametrize("seed", range(3))
def test_members_of_patches_match_the_definition(seed):
    rng = np.random.default_rng(seed)
    _, cells, low = _low(seed)
    ranges = np.hypot(*low[:, :2].T)
    patch, rings = on_model.prototype_patches(read_only(ranges), _starts(cells), 8, 2.0, 1.3)
    ring = np.floor(np.log(np.maximum(ranges / 2, 1)) / np.log(1.3)).astype(int)
    assert rings == ring.max() + 1
    assert (patch == cells // _GRID.bins * 8 // _GRID.sectors * rings + ring).all()

    chosen, on_plane = rng.random(len(low)) < 0.7, rng.random(len(low)) < 0.6
    members, first, occupied, start = on_model.patch_members(
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
    above, seeds, max_residuals = on_model.select_seeds(*columns, 0.3, 50.0, 0.15)
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
    knots = on_model.knots_between_prototypes(
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
    _, cells, low = _low(seed)
    low = low * [1.0, 0.1, 1.0] @ np.linalg.qr(np.diag([1, 1, 0]) + 0.3)[0]
    starts = _starts(cells)
    chosen = (np.arange(len(low)) % 5 == 0) & (np.arange(len(low)) > starts[4])
    count, breadth, sectors = on_model.extent(read_only(low), read_only(chosen), starts)
    assert count == chosen.sum()
    covariance = np.cov(low[chosen, :2].T, bias=True)
    assert breadth == pytest.approx(np.sqrt(np.linalg.eigvalsh(covariance)[0]))
    assert sectors == sum(chosen[a:b].any() for a, b in itertools.pairwise(starts))
    nothing = read_only(np.zeros(len(low), dtype=bool))
    assert on_model.extent(read_only(low), nothing, starts) == (0, 0.0, 0)


def test_every_kernel_has_one_compiled_signature():
    for kernel in (
        passes.lowest_points, passes.gather_prototypes, passes.sharp_prototypes,
        passes.classify_points, passes.rotated_points,
        lower_envelope, grow_patches, blended_patch_heights, best_sampled_plane, refined_plane,
        weighted_columns, on_model.prototype_patches, on_model.patch_members, on_model.select_seeds,
        on_model.knots_between_prototypes, on_model.extent,
    ):  # fmt: skip
        assert len(getattr(kernel, "signatures", ())) <= 1, kernel
