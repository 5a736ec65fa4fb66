import itertools

import numpy as np
import pytest

from reference import polar
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput
from scanlock.kernels.points.polar import polar_cells

_GRIDS = [
    PolarGrid(),
    PolarGrid(sectors=3, max_range=10.0, first_width=10.0),
    PolarGrid(sectors=7, max_range=20.0, first_width=0.3),
    PolarGrid(sectors=360, max_range=60.0, first_width=0.25, growth=1.05),
    PolarGrid(sectors=90, max_range=100.0, first_width=1.0, growth=3.0),
    PolarGrid(sectors=180, max_range=80.0, first_width=0.1, growth=1.0 + 1e-9),
]


def _on_x_axis(ranges):
    points = np.zeros((len(ranges), 3))
    points[:, 0] = ranges
    return PointCloud.from_array(points).points


@pytest.mark.slow
@pytest.mark.parametrize("grid", _GRIDS)
def test_cells_of_random_points_match_the_definition(grid):
    rng = np.random.default_rng(11)
    # Dense near the sensor, like a scan, and past the last edge.
    radius = grid.max_range * 1.2 * rng.random(3000) ** 2
    azimuth = rng.uniform(-np.pi, np.pi, 3000)
    points = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), azimuth])
    clear = [polar.distance_to_sector_edge(x, y, grid.sectors) > 1e-9 for x, y, _ in points]
    points = points[clear]
    expected = [polar.cell(x, y, grid.sectors, grid.edges) for x, y, _ in points]
    np.testing.assert_array_equal(grid.cells(points), expected)
    assert -1 in expected
    assert len(set(expected)) > 2


@pytest.mark.parametrize("grid", _GRIDS)
def test_edges_match_the_definition(grid):
    expected = polar.edges(grid.max_range, grid.first_width, grid.growth)
    assert grid.bins == len(expected) - 1
    np.testing.assert_allclose(grid.edges, expected, rtol=1e-9)
    assert grid.edges[0] == 0.0
    assert grid.edges[-1] == grid.max_range
    assert (np.diff(grid.edges) > 0).all()


@pytest.mark.parametrize("grid", _GRIDS)
def test_a_range_on_an_edge_belongs_to_the_outer_bin(grid):
    edges = grid.edges
    np.testing.assert_array_equal(grid.cells(_on_x_axis(edges[:-1])), np.arange(grid.bins))
    just_inside = np.nextafter(edges[1:], 0.0)
    np.testing.assert_array_equal(grid.cells(_on_x_axis(just_inside)), np.arange(grid.bins))
    assert grid.cells(_on_x_axis([grid.max_range])) == [-1]


def test_rounding_makes_no_additional_bin():
    # Rounding: 3.0 / 0.1 is less than 30, and 30 * 0.1 more than 3.
    for width, max_range in itertools.product([0.1, 0.2, 0.3, 0.7], [3.0, 4.2, 8.4, 42.0]):
        count = round(max_range / width, 6)
        assert PolarGrid(first_width=width, max_range=max_range).bins == int(np.ceil(count))


@pytest.mark.parametrize("sectors", [3, 4, 180, 361])
def test_azimuth_wraps_without_a_gap(sectors):
    grid = PolarGrid(sectors=sectors, max_range=10.0, first_width=10.0)
    middles = (np.arange(-2 * sectors, 2 * sectors) + 0.5) * 2 * np.pi / sectors
    points = np.column_stack([np.cos(middles), np.sin(middles), 0 * middles])
    expected = np.arange(-2 * sectors, 2 * sectors) % sectors
    np.testing.assert_array_equal(grid.cells(points), expected)


def test_azimuth_zero_belongs_to_the_first_sector():
    grid = PolarGrid(sectors=180, max_range=10.0, first_width=10.0)
    seam = np.array([[1.0, 0.0, 0.0], [1.0, -0.0, 0.0], [0.0, 0.0, 5.0]])
    np.testing.assert_array_equal(grid.cells(seam), [0, 0, 0])
    # Behind the sensor, both signs of a zero y give the azimuth pi.
    np.testing.assert_array_equal(grid.cells(np.array([[-1.0, 0.0, 0], [-1.0, -0.0, 0]])), [90, 90])


@pytest.mark.parametrize("y", [-1e-300, -1e-20, -1e-16, -1e-9])
@pytest.mark.parametrize("sectors", [3, 180, 360, 1000])
def test_an_azimuth_rounded_to_two_pi_remains_in_the_last_sector(sectors, y):
    grid = PolarGrid(sectors=sectors, max_range=10.0, first_width=10.0)
    np.testing.assert_array_equal(grid.cells(np.array([[1.0, y, 0.0]])), [sectors - 1])


def test_cells_are_read_only_integers():
    cells = PolarGrid().cells(_on_x_axis([1.0, 2.0]))
    assert cells.dtype == np.int64
    assert not cells.flags.writeable


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"sectors": 2}, "sectors must be a whole number of at least 3, got 2"),
        ({"sectors": 7.5}, "sectors must be a whole number"),
        ({"max_range": -80.0}, "max_range must be positive, got -80.0 m"),
        ({"max_range": float("inf")}, "max_range must be positive, got inf m"),
        ({"first_width": 0.0}, "first_width must be at least 8e-05 m, got 0.0 m"),
        ({"first_width": 1e-9}, "first_width must be at least 8e-05 m, got 1e-09 m"),
        ({"first_width": float("nan")}, "first_width must be at least 8e-05 m, got nan m"),
        ({"first_width": 81.0}, "first_width must not exceed max_range, got 81.0 m > 80.0 m"),
        ({"growth": 0.99}, "growth must be at least 1.0, got 0.99"),
    ],
)
def test_invalid_settings_are_rejected_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        PolarGrid(**settings)


def test_every_input_of_a_cloud_uses_one_compiled_signature():
    rng = np.random.default_rng(2)
    xyz = rng.normal(scale=20, size=(50, 3))
    wide = rng.normal(scale=20, size=(100, 5))
    given = [
        xyz,
        xyz.astype(np.float32),
        xyz.astype(">f8"),
        xyz.astype(np.int16),
        np.asfortranarray(xyz),
        wide,
        wide[::2, 1:],
        xyz.tolist(),
    ]
    for grid in (PolarGrid(), PolarGrid(sectors=np.int32(90), growth=1.1)):
        for array in given:
            cloud = PointCloud.from_array(array)
            grid.cells(cloud.points)
            # Indexing a frozen array gives a writable or strided one.
            grid.cells(cloud.points[cloud.points[:, 2] > 0])
            grid.cells(cloud.points[::2])
    assert len(polar_cells.signatures) == 1


@pytest.mark.data
def test_cells_of_a_real_scan_match_the_definition(scan_data):
    [path, *_] = sorted((scan_data / "kitti_drive_0005").glob("**/velodyne_points/data/*.bin"))
    scan = np.fromfile(path, np.float32).reshape(-1, 4)
    cloud = PointCloud.from_array(scan)
    assert len(cloud) == len(scan)
    grid = PolarGrid(first_width=0.3, growth=1.03)
    sample = cloud.points[::150]
    clear = [polar.distance_to_sector_edge(x, y, grid.sectors) > 1e-9 for x, y, _ in sample]
    expected = [polar.cell(x, y, grid.sectors, grid.edges) for x, y, _ in sample[clear]]
    np.testing.assert_array_equal(grid.cells(cloud.points)[::150][clear], expected)
    assert len(expected) > 500
