"""Ground segmentation on scenes with known answers."""

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput
from scanlock.geometry.rotations import exp_rotation
from scanlock.segmentation.ground.finder import GroundFinder, GroundStatus, PublishedGroundFinder
from scanlock.segmentation.ground.prototypes import Prototypes
from scanlock.segmentation.ground.published import lowest_seeds


def ring(rng, count=20_000, near=3.0, far=40.0):
    """Horizontal positions in a disc, densest near the sensor like lidar returns."""
    radius = near * (far / near) ** rng.random(count)
    azimuth = rng.uniform(-np.pi, np.pi, count)
    return np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth)])


def terrain(rng, shape, noise=0.02, **extent):
    """Ground points of a height function of x and y."""
    xy = ring(rng, **extent)
    return np.column_stack([xy, shape(*xy.T) + rng.normal(0, noise, len(xy))])


def wall(rng, start, end, low, high, count=1500):
    """Points on a vertical wall between two positions."""
    along = rng.random(count)[:, None]
    xy = np.array(start) + along * (np.array(end) - np.array(start))
    return np.column_stack([xy, rng.uniform(low, high, count)])


def flat_scene(rng, height=1.7):
    """Flat ground with two walls and a pole, and the mask of its ground points."""
    ground = terrain(rng, lambda x, y: 0 * x - height)
    objects = [
        wall(rng, (-10, 8), (10, 8), -height, 3 - height),
        wall(rng, (-10, -8), (10, -8), -height, 3 - height),
        wall(rng, (5, 0), (5.2, 0), -height, 5 - height, 200),
    ]
    # Walls hide the ground behind them.
    ground = ground[np.abs(ground[:, 1]) < 8]
    points = np.concatenate([ground, *objects])
    return points, np.arange(len(points)) < len(ground)


def find(points, finder=None):
    return (finder or GroundFinder()).find(PointCloud.from_array(points))


def recall_and_leak(points, is_terrain, ground, clear=0.35):
    """Fraction of the ground that is found, and of the points clearly above that are ground."""
    z = points[:, 2]
    above = ~is_terrain & (z > np.median(z[is_terrain]) + clear)
    return ground.is_ground[is_terrain].mean(), ground.is_ground[above].mean()


@pytest.mark.parametrize("shift", [-30.0, -4.0, 0.0, 1.5, 40.0])
def test_flat_ground_is_found_from_any_height(shift):
    points, is_terrain = flat_scene(np.random.default_rng(1))
    ground = find(points + np.array([0, 0, shift]))
    assert ground.status is GroundStatus.FOUND
    assert ground.sensor_height == pytest.approx(1.7 - shift, abs=0.05)
    assert ground.tilt < 0.01
    found, leaked = recall_and_leak(points, is_terrain, ground)
    assert found > 0.995
    assert leaked == 0


@pytest.mark.parametrize(
    "shape",
    [
        lambda x, y: 0.15 * x - 1.7,
        lambda x, y: -0.1 * x + 0.2 * y - 1.7,
        lambda x, y: np.where(np.abs(y) > 4, -1.55, -1.7),
        lambda x, y: 0.6 * np.sin(x / 6) + 0.5 * np.cos(y / 8) - 2.0,
        lambda x, y: np.clip(0.4 * (np.abs(y) - 6), 0, 3) - 1.7,
    ],
    ids=["slope", "side slope", "kerb", "hills", "cutting"],
)
def test_ground_of_many_shapes_is_found(shape):
    rng = np.random.default_rng(2)
    ground = terrain(rng, shape)
    poles = [
        wall(rng, xy, xy, shape(*np.array(xy)), shape(*np.array(xy)) + 4, 150)
        for xy in [(6.0, 3.0), (-9.0, 2.0), (2.0, -12.0), (15.0, 10.0)]
    ]
    points = np.concatenate([ground, *poles])
    is_terrain = np.arange(len(points)) < len(ground)
    found = find(points)
    assert found.status is not GroundStatus.NONE
    assert found.is_ground[is_terrain].mean() > 0.97
    clear = points[:, 2] > shape(*points[:, :2].T) + 0.5
    assert not found.is_ground[clear].any()
    known = found.is_ground & is_terrain
    error = found.height[known] - (points[known, 2] - shape(*points[known, :2].T))
    assert np.abs(error).mean() < 0.08


def test_both_levels_of_an_embankment_are_ground():
    rng = np.random.default_rng(3)
    road = terrain(rng, lambda x, y: 0 * x - 1.7)
    road = road[np.abs(road[:, 1]) < 5]
    # The slope is occluded from the road.
    field = terrain(rng, lambda x, y: 0 * x - 4.7, near=14.0)
    field = field[np.abs(field[:, 1]) > 14]
    ground = find(np.concatenate([road, field]))
    assert ground.sensor_height == pytest.approx(1.7, abs=0.1)
    assert ground.is_ground.mean() > 0.98


@pytest.mark.parametrize("degrees", [8.0, 20.0, 35.0])
def test_a_tilted_sensor_finds_the_same_ground(degrees):
    points, is_terrain = flat_scene(np.random.default_rng(4))
    tilt = exp_rotation(np.radians(degrees) * np.array([0.6, -0.8, 0.0]))
    ground = find(points @ tilt.T)
    assert ground.status is GroundStatus.TILTED
    assert np.degrees(ground.tilt) == pytest.approx(degrees, abs=0.5)
    assert np.allclose(ground.up, tilt[:, 2], atol=0.01)
    found, leaked = recall_and_leak(points, is_terrain, ground)
    assert found > 0.99
    assert leaked < 0.001
    assert "off the z axis" in ground.reason


def test_a_sensor_tilted_beyond_the_threshold_has_no_ground():
    points, _ = flat_scene(np.random.default_rng(4))
    tilt = exp_rotation(np.radians(20) * np.array([1.0, 0.0, 0.0]))
    finder = GroundFinder(max_tilt=np.radians(10), level_tilt=np.radians(5))
    assert find(points @ tilt.T, finder).status is GroundStatus.NONE


@pytest.mark.parametrize("seed", range(6))
def test_the_ground_is_found_at_any_attitude_and_labels_the_same_points(seed):
    points, _ = flat_scene(np.random.default_rng(4))
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    ground, expected = find(points @ turn.T, GroundFinder(max_tilt=np.pi)), find(points)
    assert ground.status is GroundStatus.TILTED
    assert np.allclose(ground.up, turn @ expected.up, atol=0.01)
    assert ground.plane[3] == pytest.approx(expected.plane[3], abs=0.05)
    assert (ground.is_ground == expected.is_ground).mean() > 0.99


def test_an_upright_scan_has_the_same_ground_whatever_the_largest_tilt():
    points, _ = flat_scene(np.random.default_rng(4))
    usual, any_tilt = find(points), find(points, GroundFinder(max_tilt=np.pi))
    assert (usual.height == any_tilt.height).all()
    assert (usual.plane == any_tilt.plane).all()


def test_planes_beyond_the_largest_tilt_are_not_ground():
    points, _ = flat_scene(np.random.default_rng(4))
    on_its_side = points @ exp_rotation(np.array([np.radians(90.0), 0.0, 0.0])).T
    ground = find(on_its_side, GroundFinder(max_tilt=np.radians(60.0)))
    assert ground.tilt < np.radians(60.0)
    assert find(on_its_side, GroundFinder(max_tilt=np.radians(100.0))).tilt == pytest.approx(
        np.radians(90.0), abs=0.01
    )


def test_reflections_below_ground_are_neither_ground_nor_obstacles():
    rng = np.random.default_rng(5)
    points, is_terrain = flat_scene(rng)
    reflections = terrain(rng, lambda x, y: -1.7 - rng.uniform(0.8, 4, len(x)), count=150, far=20.0)
    reflections = reflections[np.abs(reflections[:, 1]) < 7.5]
    ground = find(np.concatenate([points, reflections]))
    assert not ground.is_ground[len(points) :].any()
    assert ground.is_below[len(points) :].mean() > 0.9
    assert ground.is_ground[: len(points)][is_terrain].mean() > 0.98
    assert not (ground.is_ground & ground.is_below).any()


def test_the_roof_under_the_sensor_is_not_ground():
    rng = np.random.default_rng(6)
    points, is_terrain = flat_scene(rng)
    roof = np.column_stack([rng.uniform(-1.2, 1.2, (800, 2)), rng.normal(-0.3, 0.01, 800)])
    ground = find(np.concatenate([points, roof]))
    assert not ground.is_ground[len(points) :].any()
    assert ground.is_ground[: len(points)][is_terrain].mean() > 0.995


def test_objects_behind_occluded_ground_are_not_ground():
    rng = np.random.default_rng(7)
    ground = terrain(rng, lambda x, y: 0 * x - 1.7)
    # A wide truck occludes the ground behind it; only upper storeys are visible above its roof.
    occluded = (ground[:, 0] > 8) & (np.abs(ground[:, 1]) < 0.5 * ground[:, 0])
    truck = wall(rng, (8, -4), (8, 4), -1.2, 1.5)
    house = wall(rng, (25, -11), (25, 11), 1.0, 8.0, 3000)
    points = np.concatenate([ground[~occluded], truck, house])
    found = find(points)
    assert not found.is_ground[-3000:].any()
    assert not found.is_ground[points[:, 2] > -1.1].any()


def _clouds_without_ground():
    rng = np.random.default_rng(8)
    box = rng.uniform(-10, 10, (20_000, 3))
    stems = [wall(rng, p, p, -1, 6, 300) for p in rng.uniform(-20, 20, (60, 2))]
    yield "one wall", wall(rng, (-15, 8), (15, 8), -1.7, 5, 5000)
    yield "four walls", np.concatenate(
        [wall(rng, a, b, -1.7, 4, 3000) for a, b in
         [((-9, -9), (9, -9)), ((9, -9), (9, 9)), ((9, 9), (-9, 9)), ((-9, 9), (-9, -9))]]
    )  # fmt: skip
    yield "a box of noise", box
    yield "a ball of noise", rng.normal(0, 5, (20_000, 3))
    yield "a layer of leaves", np.column_stack([30 * box[:, :2], 5 + rng.normal(0, 1, len(box))])
    yield "stems only", np.concatenate(stems)
    yield (
        "a table",
        np.column_stack([rng.uniform(1, 2.4, (5000, 2)), rng.normal(-0.5, 0.005, 5000)]),
    )
    yield "a line", np.column_stack([np.linspace(1, 30, 500), np.zeros(500), np.zeros(500)])
    yield "one point", np.ones((1, 3))
    yield "two points", np.array([[1.0, 0, 0], [5.0, 1, 0]])
    yield "identical points", np.full((100, 3), 2.0)
    yield "the origin", np.zeros((10, 3))
    yield "beyond the range", box + np.array([500.0, 0, 0])


@pytest.mark.parametrize(
    "points", [pytest.param(cloud, id=name) for name, cloud in _clouds_without_ground()]
)
def test_without_reliable_ground_no_point_is_ground(points):
    ground = find(points)
    assert ground.status is GroundStatus.NONE
    assert ground.is_ground.shape == ground.is_below.shape == (len(points),)
    assert not ground.is_ground.any()
    assert np.isnan(ground.height).all()
    assert np.isnan(ground.sensor_height)
    assert ground.up.tolist() == [0, 0, 1]
    assert ground.sectors == 0
    assert ground.reason


def test_rows_follow_the_cloud_without_invalid_rows():
    points, _ = flat_scene(np.random.default_rng(9))
    points[::7] = np.nan
    cloud = PointCloud.from_array(points)
    ground = GroundFinder().find(cloud)
    assert len(ground.is_ground) == len(ground.height) == len(cloud) < len(points)
    assert not np.isnan(ground.height[ground.is_ground]).any()


def test_far_coordinates_have_no_sensor_height():
    points, is_terrain = flat_scene(np.random.default_rng(10))
    offset = np.array([4e5, 5e6, 100.0])
    ground = find(points + offset)
    assert np.isnan(ground.sensor_height)
    assert ground.is_ground[is_terrain].mean() > 0.99


def test_results_are_bitwise_reproducible_and_read_only():
    points, _ = flat_scene(np.random.default_rng(11))
    first, second = find(points), find(points.copy())
    assert (first.is_ground == second.is_ground).all()
    assert np.array_equal(first.height, second.height, equal_nan=True)
    assert np.array_equal(first.plane, second.plane)
    with pytest.raises(ValueError, match="read-only"):
        first.is_ground[0] = True


def test_the_published_form_labels_every_point_and_has_its_defects():
    rng = np.random.default_rng(12)
    points, is_terrain = flat_scene(rng)
    # Slabs 0.7 to 2 m above ground that is occluded, as behind cars.
    azimuth = np.arange(12) * np.pi / 6
    slabs = np.concatenate([
        [16 * np.cos(a), 16 * np.sin(a), lift - 1.7] + rng.uniform(-1, 1, (300, 3)) * [1, 1, 0]
        for a, lift in zip(azimuth, np.linspace(0.7, 2.0, 12), strict=True)
    ])  # fmt: skip
    across = np.arctan2(points[:, 1], points[:, 0])[:, None] - azimuth
    behind = (np.abs(np.angle(np.exp(1j * across))) < 0.12).any(axis=1)
    kept = is_terrain & ~(behind & (np.hypot(*points[:, :2].T) > 13))
    scene = np.concatenate([points[kept], slabs])
    is_slab = np.arange(len(scene)) >= kept.sum()
    published = find(scene, PublishedGroundFinder())
    assert published.status is GroundStatus.FOUND
    assert len(published.is_ground) == len(scene)
    assert published.is_ground[is_slab].mean() > 0.9
    assert find(scene).is_ground[is_slab].mean() < 0.02
    # No prototype is within 15 m of the height of a sensor high above the ground.
    high = find(points - np.array([0, 0, 20]), PublishedGroundFinder())
    assert high.status is GroundStatus.NONE


def test_a_coarse_grid_is_accepted():
    points, is_terrain = flat_scene(np.random.default_rng(13))
    for grid in (PolarGrid(sectors=3), PolarGrid(sectors=7, first_width=3.0)):
        ground = find(points, GroundFinder(grid=grid, min_support=0.0))
        assert ground.is_ground[~is_terrain & (points[:, 2] > -1)].mean() < 0.05


@pytest.mark.parametrize("max_count", [2, 3, None])
def test_published_seeds_are_the_lowest_prototypes_near_the_sensor(max_count):
    rng = np.random.default_rng(14)
    points = np.column_stack([rng.uniform(-20, 20, (60, 2)), rng.uniform(-3, 3, 60)])
    prototypes = Prototypes.of(points, PolarGrid(sectors=9, max_range=30.0, first_width=1.0), 1)
    seeds = lowest_seeds(prototypes, max_height=2.0, max_range=18.0, max_count=max_count)
    heights = prototypes.points[:, 2]
    counts = []
    for first, last in itertools.pairwise(prototypes.starts):
        rows = np.arange(first, last)
        near = rows[(np.abs(heights[rows]) < 2.0) & (prototypes.ranges[rows] < 18.0)]
        lowest = sorted(near, key=heights.__getitem__)[:max_count]
        counts.append(len(lowest))
        assert set(rows[seeds[rows]]) == (set(lowest) if len(lowest) >= 2 else set())
    assert min(counts) < 2 < max(counts) or max_count == 2


@pytest.mark.parametrize(
    ("settings", "name", "value"),
    [
        *(
            (settings, name, value)
            for settings in (GroundFinder, PublishedGroundFinder)
            for name, value in (
                ("height_threshold", 0.0),
                ("max_seed_height", float("nan")),
                ("max_seed_range", 0.0),
                ("min_points", 0),
            )
        ),
        (GroundFinder, "min_support", 1.5),
        (GroundFinder, "min_sharpness", -0.1),
        (GroundFinder, "level_tilt", 0.0),
        (GroundFinder, "max_tilt", 3.2),
        (PublishedGroundFinder, "max_seeds", 1),
    ],
)
def test_invalid_settings_are_rejected_by_name(settings, name, value):
    with pytest.raises(InvalidInput, match=name):
        settings(**{name: value})


@pytest.mark.data
def test_the_sensor_height_of_a_street_scan_is_estimated(scan_data):
    for number in (0, 40):
        scan = scan_data / "kitti_drive_0005" / "velodyne_points" / "data" / f"{number:010d}.bin"
        ground = find(np.fromfile(scan, np.float32).reshape(-1, 4))
        assert ground.status is GroundStatus.FOUND
        assert ground.sensor_height == pytest.approx(1.76, abs=0.08)
        assert 0.55 < ground.is_ground.mean() < 0.7
        assert ground.is_below.mean() < 0.01


@pytest.mark.data
def test_stems_in_a_forest_are_not_ground(scan_data):
    for scan in sorted((scan_data / "forest_os1").glob("*_xyzl.bin")):
        raw = np.fromfile(scan, np.float32).reshape(-1, 4)
        ground = find(raw)
        assert ground.is_ground[raw[:, 3] == 1].mean() < 0.06
        assert ground.is_ground.mean() > 0.25


@pytest.mark.data
def test_off_road_ground_agrees_with_its_labels(scan_data):
    folder = scan_data / "rellis_offroad"
    xyz = np.fromfile(folder / "000104.bin", np.float32).reshape(-1, 4)[:, :3]
    label = np.fromfile(folder / "000104.label", np.uint32)
    is_labelled = (np.abs(xyz).max(axis=1) > 0) & (label != 0)
    found = find(xyz).is_ground[is_labelled]
    truth = np.isin(label, (1, 3, 10, 23, 31, 33))[is_labelled]
    assert (found & truth).sum() / truth.sum() > 0.97
    assert (found & truth).sum() / found.sum() > 0.85
