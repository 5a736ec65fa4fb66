import dataclasses
import hashlib

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.simulation import (
    CAR,
    ROBOT,
    SCENES,
    Scene,
    SurfaceClass,
    World,
    carried,
    forest,
    forest_walk,
    hdl_32e,
    hdl_64e,
    simulate_scan,
    street_drive,
)

pytestmark = pytest.mark.slow

_SEED = 3
_KITTI_EDGES = [0, 5, 10, 15, 20, 30, 40, 60, 80, 120]


def _scans(scene, drive, sensor):
    return [
        simulate_scan(scene.world, sensor, pose, np.random.default_rng(k), time=time, twist=twist)
        for k, (pose, time, twist) in enumerate(
            zip(drive.poses, drive.times, drive.twists, strict=True)
        )
    ]


@pytest.fixture(scope="module")
def street_scans(street_scene):
    lap = street_scene.track.length
    drive = street_drive(street_scene, np.random.default_rng(1), count=12, spacing=lap / 12)
    return _scans(street_scene, drive, hdl_64e())


@pytest.fixture(scope="module")
def forest_scans(forest_scene):
    lap = forest_scene.track.length
    drive = forest_walk(forest_scene, np.random.default_rng(1), count=12, spacing=lap / 12)
    return _scans(forest_scene, drive, hdl_32e())


def _shares(points):
    ranges = np.linalg.norm(points, axis=1)
    return np.histogram(ranges, _KITTI_EDGES)[0] / len(points)


def test_a_street_scan_has_many_objects_near_and_far(street_scans):
    for scan in street_scans:
        assert 95_000 < len(scan) < 133_312
        assert len(np.unique(scan.objects)) > 80
        ground = np.isin(scan.labels, [SurfaceClass.GROUND, SurfaceClass.KERB]).mean()
        assert 0.3 < ground < 0.8
        assert _shares(scan.points)[3:7].sum() > 0.08
    seen = {SurfaceClass(label) for scan in street_scans for label in np.unique(scan.labels)}
    assert seen >= {
        SurfaceClass.GROUND, SurfaceClass.KERB, SurfaceClass.BUILDING, SurfaceClass.CAR,
        SurfaceClass.POLE, SurfaceClass.TRUNK, SurfaceClass.FOLIAGE, SurfaceClass.SHRUB,
        SurfaceClass.FENCE, SurfaceClass.PERSON, SurfaceClass.FURNITURE,
    }  # fmt: skip


def test_a_forest_scan_has_trunks_crowns_shrubs_and_grass(forest_scans):
    for scan in forest_scans:
        assert 45_000 < len(scan) < 69_440
        assert len(np.unique(scan.objects)) > 80
    labels = np.concatenate([scan.labels for scan in forest_scans])
    share = {label: (labels == label).mean() for label in SurfaceClass}
    assert 0.5 < share[SurfaceClass.GROUND] < 0.9
    assert share[SurfaceClass.TRUNK] > 0.03
    assert share[SurfaceClass.FOLIAGE] > 0.05
    assert share[SurfaceClass.SHRUB] > 0.005
    assert share[SurfaceClass.GRASS] > 0.003
    assert share[SurfaceClass.GAZEBO] > 0.0


def test_crowns_are_porous(forest_scene):
    # Some horizontal rays through the middle of crowns hit leaves, others pass.
    world, surfaces = forest_scene.world, forest_scene.world.surfaces
    through = []
    for number in np.unique(surfaces.objects[surfaces.labels == SurfaceClass.FOLIAGE])[:20]:
        leaves = surfaces.rows[
            (surfaces.objects == number) & (surfaces.labels == SurfaceClass.FOLIAGE), :3
        ]
        low, high = np.percentile(leaves, 30, axis=0), np.percentile(leaves, 70, axis=0)
        rng = np.random.default_rng(number)
        origins = rng.uniform(low, high, (200, 3))
        origins[:, 0] = leaves[:, 0].min() - 1.0
        ahead = np.tile([1.0, 0, 0], (200, 1))
        hits = world.cast(origins, ahead, 0.0, np.zeros(200), np.ptp(leaves[:, 0]) + 2.0)
        through.append(np.isinf(hits.distances).mean())
    assert 0.03 < np.median(through) < 0.8


@pytest.mark.data
def test_a_street_scan_has_the_size_and_ranges_of_a_real_one(street_scans, scan_data):
    files = sorted((scan_data / "kitti_drive_0005" / "velodyne_points" / "data").glob("*.bin"))
    real = [np.fromfile(path, np.float32).reshape(-1, 4)[:, :3] for path in files[::10]]
    assert np.median([len(s) for s in street_scans]) == pytest.approx(
        np.median([len(points) for points in real]), rel=0.1
    )
    ours = np.mean([_shares(scan.points) for scan in street_scans], axis=0)
    theirs = np.mean([_shares(points) for points in real], axis=0)
    assert 0.5 * np.abs(ours - theirs).sum() < 0.2


@pytest.mark.parametrize(
    ("name", "carrier", "spacing"), [("street", CAR, 0.85), ("forest", ROBOT, 0.2)]
)
def test_a_drive_follows_the_ground_around_the_track(name, carrier, spacing, request):
    scene = request.getfixturevalue(f"{name}_scene")
    count = int(scene.track.length / spacing) + 20
    drive = scene.drive(np.random.default_rng(0), count=count, spacing=spacing)
    positions = np.array([pose.translation for pose in drive])
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    assert np.abs(steps - spacing).max() < 0.2 * spacing
    heights = positions[:, 2] - scene.ground.at(positions)
    assert np.abs(heights - carrier.sensor_height).max() < 0.1
    tilts = np.degrees([np.arccos(pose.rotation[2, 2]) for pose in drive])
    assert 0.5 < tilts.max() < 15.0
    # A lap of the closed track returns to its start, with headings in all directions.
    assert np.linalg.norm(positions[0] - positions[-20]) < 2.0
    ahead = np.array([pose.rotation[:2, 0] for pose in drive])
    for axis in ([1, 0], [0, 1], [-1, 0], [0, -1]):
        assert (ahead @ axis).max() > 0.8
    np.testing.assert_allclose(np.diff(drive.times), spacing / carrier.speed, rtol=1e-9)
    speeds = np.linalg.norm(drive.twists[:, :3], axis=1)
    # The sensor on a mast moves back and forth as the wheels follow the ground.
    np.testing.assert_allclose(speeds, carrier.speed, rtol=0.2)


def test_sweeps_of_a_drive_are_continuous(street_scene):
    drive = street_drive(street_scene, np.random.default_rng(2), count=200, spacing=0.85)
    for k in range(199):
        end = carried(drive.poses[k], drive.twists[k], 0.05)
        start = carried(drive.poses[k + 1], drive.twists[k + 1], -0.05)
        assert end.is_close(start, translation=0.02, rotation=np.radians(0.3))


@pytest.mark.parametrize(("name", "room"), [("street", 1.2), ("forest", 0.4)])
def test_no_object_is_on_the_track(name, room, request):
    scene = request.getfixturevalue(f"{name}_scene")
    moving = {int(mover.surfaces.objects[0]) for mover in scene.world.movers}
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    for along in np.arange(0.0, scene.track.length, 6.0):
        pose = scene.sensor_pose(along)
        for below in (0.1, 0.5, 0.7 * scene.carrier.sensor_height):
            origin = pose.apply(np.array([0.0, 0.0, -below]))
            hits = scene.world.cast(
                np.tile(origin, (90, 1)), ring @ pose.rotation.T, -1e6, np.zeros(90), 5.0
            )
            solid = ~np.isin(hits.labels, [SurfaceClass.FOLIAGE, SurfaceClass.GRASS])
            standing = np.array([number not in moving for number in hits.objects]) & solid
            assert hits.distances[standing & (hits.labels > 0)].min(initial=9.0) > room


def test_traffic_keeps_its_distance_from_the_drive(street_scene):
    drive = street_drive(street_scene, np.random.default_rng(4), count=100, spacing=8.5)
    cars = [
        mover for mover in street_scene.world.movers if mover.surfaces.labels[0] == SurfaceClass.CAR
    ]
    assert len(cars) > 5
    for pose, time in zip(drive.poses, drive.times, strict=True):
        for mover in cars:
            there, velocity = mover.at(float(time))
            gap = pose.inverse().apply(there.translation)
            assert abs(gap[0]) > 6.0 or abs(gap[1]) > 2.5
            assert np.linalg.norm(velocity) > 1.0


def test_objects_of_a_street_are_unevenly_spaced(street_scene):
    surfaces = street_scene.world.surfaces
    for label in (SurfaceClass.TRUNK, SurfaceClass.POLE, SurfaceClass.BUILDING):
        of_class = surfaces.labels == label
        numbers = surfaces.objects[of_class]
        places = np.array(
            [surfaces.rows[of_class][numbers == n, :2].mean(axis=0) for n in np.unique(numbers)]
        )
        gaps = np.linalg.norm(places[:, None] - places, axis=2)
        np.fill_diagonal(gaps, np.inf)
        nearest = gaps.min(axis=1)
        assert nearest.std() > 0.25 * nearest.mean()


def _digest(scene):
    digest = hashlib.sha256()
    surfaces = scene.world.surfaces
    for array in (surfaces.kinds, surfaces.rows, surfaces.labels, surfaces.objects,
                  surfaces.losses, scene.ground.heights, scene.track.points):  # fmt: skip
        digest.update(array.tobytes())
    for mover in scene.world.movers:
        digest.update(mover.path.tobytes() + mover.surfaces.rows.tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("name", ["street", "forest"])
def test_the_same_seed_gives_the_same_bytes_of_a_scene(name, request):
    again = SCENES[name](np.random.default_rng(np.random.SeedSequence(_SEED).spawn(4)[0]))
    assert _digest(again) == _digest(request.getfixturevalue(f"{name}_scene"))


def test_another_seed_gives_another_scene(forest_scene):
    assert _digest(forest(np.random.default_rng(0))) != _digest(forest_scene)


def test_a_scene_without_ground_cannot_be_driven(forest_scene):
    bare = Scene(name="bare", world=World.of(), track=forest_scene.track, carrier=ROBOT)
    with pytest.raises(InvalidInput, match="scene bare must have ground"):
        bare.drive(np.random.default_rng(0), count=1, spacing=1.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 0}, "count must be a whole number"),
        ({"spacing": 0.0}, "spacing must be positive, got 0.0 m"),
    ],
)
def test_invalid_drives_are_refused(forest_scene, change, message):
    with pytest.raises(InvalidInput, match=message):
        forest_scene.drive(np.random.default_rng(0), **({"count": 2, "spacing": 1.0} | change))


@pytest.mark.parametrize("name", ["sensor_height", "wheelbase", "gauge", "speed", "sway", "wander"])
def test_carrier_settings_out_of_range_are_refused(name):
    with pytest.raises(InvalidInput, match=f"{name} must be"):
        dataclasses.replace(CAR, **{name: -1.0})
