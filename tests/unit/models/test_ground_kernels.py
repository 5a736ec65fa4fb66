"""The loops of ground segmentation against their slow twins."""

import numpy as np
import pytest

from reference import ground as slow
from scanlock.arrays import read_only
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.kernels import ground as passes
from scanlock.kernels.ground_envelope import lower_envelope
from scanlock.kernels.ground_patches import grow_patches, heights_of_patches
from scanlock.kernels.ground_plane import best_triple_plane, plane_moments, plane_score
from scanlock.models.ground_plane import fit_base_plane

_GRID = PolarGrid(sectors=24, max_range=30.0, first_width=1.0, growth=1.08)


def _hills(seed, count=3000):
    """Points on a rolling ground with boxes on it, reflections below it and points out of range."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-25, 25, (count, 2))
    z = 0.8 * np.sin(xy[:, 0] / 6) + 0.05 * xy[:, 1] + rng.normal(0, 0.03, count)
    z += np.where((xy[:, 0] % 9 < 2) & (xy[:, 1] % 7 < 2), rng.uniform(0, 2, count), 0)
    z[rng.random(count) < 0.003] -= 2.0
    return read_only(np.column_stack([xy, z]))


def _low(seed):
    """Low points of the hills, and what the kernels want to know of them."""
    points = _hills(seed)
    cells = _GRID.cells(points)
    lowest = passes.lowest_in_cells(points, cells, _GRID.sectors * _GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    low = points[lowest[own]]
    return [read_only(column) for column in low.T], read_only(own), low


def _starts(cells):
    """Where the cells of each sector start."""
    return read_only(np.searchsorted(cells, np.arange(_GRID.sectors + 1) * _GRID.bins))


@pytest.mark.parametrize("seed", range(3))
def test_lowest_points_and_counts(seed):
    points = np.array(_hills(seed, count=800))
    points[::3, 2] = np.round(points[::3, 2], 1)
    points = read_only(np.vstack([points, points[:50]]))
    cells = _GRID.cells(points)
    count = _GRID.sectors * _GRID.bins
    expected, filled = slow.lowest_in_cells(points, cells, count)
    for least in (4, 1):
        lowest = passes.lowest_in_cells(points, cells, count, least)
        held = lowest >= 0
        assert 0 < held.sum() < count
        assert (held == (filled >= least)).all()
        assert (points[lowest[held]] == points[expected[held]]).all()

    low, ranges, own, starts = passes.gathered_prototypes(points, read_only(lowest), _GRID.sectors)
    assert (own == np.flatnonzero(lowest >= 0)).all()
    assert (low == points[lowest[own]]).all()
    assert np.allclose(ranges, np.hypot(*low[:, :2].T), rtol=1e-15)
    assert (starts == np.searchsorted(own, np.arange(_GRID.sectors + 1) * _GRID.bins)).all()

    plane = read_only(np.array([0.05, -0.02, 0.99, 1.0]))
    near = read_only(np.random.default_rng(seed).uniform(0.1, 0.5, count))
    found = passes.count_low_points(points, cells, read_only(lowest), plane, near, 3.0)
    expected = slow.low_counts(points, cells, lowest, plane, near, 3.0)
    assert (found[0] == expected[0]).all()
    assert (found[1] == expected[1]).all()


def test_heights_above_knots_are_broken_lines():
    rng = np.random.default_rng(1)
    points = _hills(1, 500)
    cells = _GRID.cells(points)
    knots = rng.uniform(-1, 1, (_GRID.sectors * _GRID.bins, 5))
    knots[:, 0] = rng.uniform(0, 30, len(knots))
    knots[::5, 1] = np.nan
    knots[:, 4] = rng.uniform(0.1, 0.6, len(knots))
    plane = np.array([0.1, 0.0, 0.9, -0.4])
    height, is_ground, is_below, near, close = passes.split_by_knots(
        points, cells, read_only(plane), read_only(knots), 0.5
    )
    for point, cell, found in zip(points, cells, height, strict=True):
        if cell < 0 or np.isnan(knots[cell, 1]):
            assert np.isnan(found)
            continue
        step = np.hypot(*point[:2]) - knots[cell, 0]
        ground = knots[cell, 1] + step * (knots[cell, 2] if step < 0 else knots[cell, 3])
        assert found == pytest.approx(plane[:3] @ point + plane[3] - ground, abs=1e-12)
    limits = np.minimum(0.5, knots[cells, 4])
    assert is_ground.tolist() == (np.abs(height) < limits).tolist()
    assert is_below.tolist() == (height <= -0.5).tolist()
    assert (near, close) == ((np.abs(height) < 1.5).sum(), (np.abs(height) < 0.5).sum())
    assert 0 < is_ground.sum() < close < near


def test_turned_points():
    points = _hills(0, 50)
    rotation = np.linalg.qr(np.random.default_rng(0).normal(size=(3, 3)))[0]
    turned = passes.turned_points(points, read_only(rotation))
    assert np.allclose(turned, points @ rotation.T)


@pytest.mark.parametrize("seed", range(3))
def test_the_lower_envelope_is_that_of_all_cones(seed):
    (x, y, z), cells, _ = _low(seed)
    found = lower_envelope(x, y, z, cells, _starts(cells), _GRID.bins, 0.6, 0.1, 3)
    exact = slow.lower_envelope(x, y, z, cells, _GRID.sectors, _GRID.bins, 0.6, 0.1, 3)
    # Cones are passed on from cell to cell: one may be lost on the way, none is invented.
    assert (found >= exact - 1e-12).all()
    assert np.mean(found > exact + 1e-9) < 0.03


@pytest.mark.parametrize(("count", "hides"), [(1, False), (3, False), (60, True)])
def test_a_few_stray_reflections_take_no_ground_away_but_a_lower_level_does(count, hides):
    rng = np.random.default_rng(0)
    azimuth, radius = rng.uniform(-np.pi, np.pi, 4000), rng.uniform(1, 29, 4000)
    points = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), 0 * radius])
    nearest = np.argsort(np.linalg.norm(points - [15, 3, 0], axis=1))
    points[nearest[:count], 2] = -4.0
    cells = _GRID.cells(points)
    lowest = passes.lowest_in_cells(read_only(points), cells, _GRID.sectors * _GRID.bins, 1)
    own = np.flatnonzero(lowest >= 0)
    x, y, z = (read_only(column) for column in points[lowest[own]].T)
    above = z - lower_envelope(x, y, z, read_only(own), _starts(own), _GRID.bins, 0.6, 0.1, 3)
    assert ((above > 0.25).sum() > 20) == hides


def test_plane_scores_and_moments():
    rng = np.random.default_rng(5)
    low = rng.normal(0, 1, (400, 3)) * [10, 10, 0.5]
    weights, gates = rng.random(400), rng.uniform(0.2, 0.6, 400)
    normal = np.array([0.1, -0.05, 1.0]) / np.linalg.norm([0.1, -0.05, 1.0])
    columns = [read_only(column) for column in (*low.T, weights, 1 / gates)]
    found = plane_score(*columns, *normal, 0.1)
    assert found == pytest.approx(slow.plane_score(low, weights, gates, normal, 0.1))

    sums = plane_moments(*columns, 1.5, *normal, 0.1)
    mean = sums[1:4] / sums[0]
    xx, xy, xz, yy, yz, zz = sums[4:] / sums[0]
    scatter = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) - np.outer(mean, mean)
    up = np.linalg.eigh(scatter)[1][:, 0]
    expected, offset = slow.biweight_plane(low, weights, gates, 1.5, normal, 0.1)
    assert np.allclose(up * np.sign(up[2]), expected, atol=1e-9)
    assert -(up * np.sign(up[2])) @ mean == pytest.approx(offset)


def test_the_best_triple_is_the_plane_that_most_points_share():
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(-20, 20, (300, 2)), rng.normal(-1.5, 0.02, 300)])
    clutter = np.column_stack([rng.uniform(-20, 20, (600, 2)), rng.uniform(-1.5, 6, 600)])
    plane = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert plane.tilt < 0.01
    assert plane.offset == pytest.approx(1.5, abs=0.03)
    # The second time it is the same to the bit, and upside down nothing is found twice.
    again = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert (plane.coefficients == again.coefficients).all()


def test_no_plane_without_points_or_through_a_line():
    line = np.column_stack([np.linspace(1, 9, 40), np.zeros(40), np.zeros(40)])
    for low in (np.zeros((0, 3)), np.ones((2, 3)), np.ones((30, 3)), line):
        assert fit_base_plane(low, max_tilt=0.7) is None


@pytest.mark.parametrize("seed", range(3))
def test_patches_grow_as_defined(seed):
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

    heights = heights_of_patches(
        x, y, read_only(patch), read_only(patches), read_only(accepted), sectors, rings
    )
    blended = [
        slow.base_height(point, p, patches, accepted, sectors, rings)
        for point, p in zip(low, patch, strict=True)
    ]
    assert np.allclose(heights, blended, atol=1e-9, equal_nan=True)


def test_one_compiled_form_serves_all():
    for kernel in (
        passes.lowest_in_cells, passes.gathered_prototypes, passes.count_low_points,
        passes.split_by_knots, passes.turned_points,
        lower_envelope, grow_patches, heights_of_patches, best_triple_plane, plane_moments,
    ):  # fmt: skip
        assert len(getattr(kernel, "signatures", ())) <= 1, kernel
