import hashlib

import numpy as np
import pytest
from scipy.spatial import cKDTree

from scanlock.simulation import (
    SENSORS,
    XUV,
    SurfaceClass,
    carried,
    ladar_run,
    points_from_ranges,
    rugged,
    rugged_drive,
    simulate_scan,
)

pytestmark = pytest.mark.slow

_SEED = 2
_SOFT = [SurfaceClass.FOLIAGE, SurfaceClass.GRASS]


@pytest.fixture(scope="module")
def terrain(_compiler):
    return rugged(np.random.default_rng(_SEED))


@pytest.fixture(scope="module")
def lap(terrain):
    """A drive of slightly more than one lap."""
    count = int(terrain.track.length / 0.56) + 20
    return rugged_drive(terrain, np.random.default_rng(0), count=count)


def _pairs(terrain, interval, speed):
    """Pairs of frames at a given interval, at eight positions along the track."""
    for k, start in enumerate(np.linspace(0.0, 0.9 * terrain.track.length, 8)):
        run = ladar_run(k, scene=terrain, count=interval + 1, speed=speed, start=start)
        yield run[0], run[interval]


def _closest(target, source):
    """Distances of closest points between two frames at the exact pose."""
    target_from_source = target.pose.inverse() @ source.pose
    moved = target_from_source.apply(source.deskewed())
    return cKDTree(target.deskewed()).query(moved)[0]


def test_the_same_seed_gives_the_same_bytes(terrain):
    def digest(scene):
        surfaces = scene.world.surfaces
        arrays = (surfaces.kinds, surfaces.rows, surfaces.labels, surfaces.objects,
                  scene.ground.heights, scene.track.points)  # fmt: skip
        return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()

    assert digest(rugged(np.random.default_rng(_SEED))) == digest(terrain)


def test_the_terrain_has_hills_bumps_and_ruts(terrain):
    heights = terrain.ground.heights
    assert np.ptp(heights) > 3.0
    slopes = np.degrees(np.arctan(np.hypot(*np.gradient(heights, terrain.ground.cell))))
    assert 5.0 < np.median(slopes) < 15.0
    # Bumps and ruts are the profile along the track minus its mean over 3 m.
    along = np.arange(0.0, terrain.track.length, 0.25)
    profile = terrain.ground.at(terrain.track.at(along))
    smooth = np.convolve(np.pad(profile, 6, mode="wrap"), np.full(13, 1 / 13), mode="valid")
    bumps = profile - smooth
    assert 0.02 < bumps.std() < 0.12
    assert np.abs(bumps).max() > 0.1


def test_the_vehicle_pitches_and_rolls_with_the_terrain(terrain, lap):
    positions = np.array([pose.translation for pose in lap])
    heights = positions[:, 2] - terrain.ground.at(positions)
    assert np.median(heights) == pytest.approx(XUV.sensor_height, abs=0.05)
    assert np.abs(heights - XUV.sensor_height).max() < 0.3
    pitch = np.degrees([np.arcsin(-pose.rotation[2, 0]) for pose in lap])
    roll = np.degrees([np.arcsin(pose.rotation[2, 1]) for pose in lap])
    for angle in (pitch, roll):
        assert 3.0 < angle.std() < 9.0
        assert 8.0 < np.abs(angle).max() < 25.0
    rate = np.degrees(np.abs(lap.twists[:, 3:5])).max()
    assert 30.0 < rate < 150.0


def test_the_wheels_are_on_the_ground(terrain, lap):
    # The suspension tilts the body by about a degree; four wheels fit uneven ground to centimetres.
    for pose in lap.poses[::25]:
        feet = np.array([[a, b, -XUV.sensor_height] for a in (1.0, -1.0) for b in (0.7, -0.7)])
        below = pose.apply(feet)
        heights = below[:, 2] - terrain.ground.at(below)
        assert abs(heights.mean()) < 0.1
        assert np.abs(heights).max() < 0.35


def test_a_drive_has_the_given_speed_and_continuous_sweeps(terrain, lap):
    steps = np.diff(lap.times)
    np.testing.assert_allclose(steps, 0.1, rtol=1e-9)
    fast = rugged_drive(
        terrain, np.random.default_rng(0), count=len(lap), spacing=0.56, speed=35.0 / 3.6
    )
    for drive, kmh in ((lap, 20.0), (fast, 35.0)):
        speeds = 3.6 * np.linalg.norm(drive.twists[:, :3], axis=1)
        assert speeds.mean() == pytest.approx(kmh, rel=0.1)
    assert all(a == b for a, b in zip(fast.poses, lap.poses, strict=True))
    differences = [
        carried(lap.poses[k], lap.twists[k], 0.05).distance(
            carried(lap.poses[k + 1], lap.twists[k + 1], -0.05)
        )
        for k in range(300)
    ]
    # Twists are means over 0.1 s, so that a sweep ends about where the next begins.
    metres, radians = np.array(differences).T
    assert np.median(metres) < 0.04
    assert metres.max() < 0.2
    assert np.degrees(radians.max()) < 8.0


def test_no_tree_shrub_or_rock_is_on_the_track(terrain):
    angles = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    ring = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    for along in np.arange(0.0, terrain.track.length, 5.0):
        pose = terrain.sensor_pose(along)
        # Only knee-high herbs grow on the track.
        for above in (1.0, 1.5, 2.0):
            origin = pose.apply(np.array([0.0, 0.0, above - XUV.sensor_height]))
            hits = terrain.world.cast(
                np.tile(origin, (90, 1)), ring @ pose.rotation.T, 0.0, np.zeros(90), 5.0
            )
            solid = (hits.labels > 0) & ~np.isin(hits.labels, _SOFT)
            assert hits.distances[solid].min(initial=9.0) > 0.9


def test_plants_are_near_and_far(terrain, lap):
    scans = [
        simulate_scan(terrain.world, SENSORS["hdl_32e"](), pose, np.random.default_rng(0))
        for pose in lap.poses[::60]
    ]
    labels = np.concatenate([scan.labels for scan in scans])
    assert {SurfaceClass(label) for label in np.unique(labels)} == {
        SurfaceClass.GROUND, SurfaceClass.GRASS, SurfaceClass.SHRUB, SurfaceClass.TRUNK,
        SurfaceClass.FOLIAGE, SurfaceClass.ROCK,
    }  # fmt: skip
    share = {label: (labels == label).mean() for label in SurfaceClass}
    assert 0.3 < share[SurfaceClass.GROUND] < 0.75
    assert share[SurfaceClass.SHRUB] > 0.1
    assert share[SurfaceClass.GRASS] > 0.03
    assert share[SurfaceClass.FOLIAGE] + share[SurfaceClass.TRUNK] > 0.04
    for scan in scans:
        plants = np.isin(scan.labels, [*_SOFT, SurfaceClass.SHRUB])
        ranges = np.linalg.norm(scan.points[plants], axis=1)
        assert (ranges < 10.0).sum() > 300
        assert (ranges > 25.0).sum() > 100


def test_a_frame_has_about_as_many_points_as_in_the_paper(terrain):
    counts = [len(frame) for frame, _ in _pairs(terrain, 1, 4.2)]
    # The paper's four: 4848, 4852, 5349 and 5352 of 5760.
    assert 4600 < np.median(counts) < 5500
    assert min(counts) > 3300
    assert max(counts) < 5700


def test_a_frame_is_ahead_and_down_with_ranges_of_a_few_metres(terrain):
    for frame, _ in _pairs(terrain, 1, 4.2):
        assert (frame.points[:, 0] > 1.5).all()
        ranges = frame.ranges[np.isfinite(frame.ranges)]
        assert ranges.min() > 0.8
        assert ranges.max() < 60.0
        assert 4.0 < np.median(ranges) < 15.0
        # Upper rows have larger ranges.
        assert np.nanmedian(frame.ranges[:8]) > 1.5 * np.nanmedian(frame.ranges[-8:])
        assert np.isin(frame.labels, [SurfaceClass.SHRUB, SurfaceClass.GRASS]).mean() > 0.02


@pytest.mark.parametrize(
    ("interval", "speed"), [(1, 15.0 / 3.6), (20, 0.1)], ids=["consecutive", "twenty apart"]
)
def test_closest_distances_at_the_exact_pose_match_the_paper(terrain, interval, speed):
    # The paper: 5.8 cm for consecutive scans, 4.6 cm at an interval of twenty, for inliers.
    inliers, aligned, unaligned = [], [], []
    for target, source in _pairs(terrain, interval, speed):
        distances = _closest(target, source)
        threshold = distances.mean() + 3.0 * distances.std()
        inliers.append(distances[distances <= threshold].mean())
        aligned.append(distances.mean())
        unaligned.append(cKDTree(target.deskewed()).query(source.deskewed())[0].mean())
    assert 0.04 < np.median(inliers) < 0.14
    assert np.median(unaligned) > 1.1 * np.median(aligned)


def test_frames_at_rest_differ_only_by_noise(terrain):
    means = [_closest(*pair).mean() for pair in _pairs(terrain, 20, 1e-6)]
    # Two readings with a noise of 3.5 cm differ by 1.1 * 3.5 cm on average.
    assert 0.02 < np.median(means) < 0.055


def test_a_wrong_calibration_distorts_the_points(terrain):
    run = ladar_run(1, scene=terrain, count=1)
    frame, wrong = run[0], type(run.mount)(tilt_zero=0.05)
    distorted = points_from_ranges(frame.ranges, run.ladar, wrong, pan=frame.pan, tilt=frame.tilt)
    differences = np.linalg.norm(distorted[np.isfinite(frame.ranges)] - frame.points, axis=1)
    # The displacement by a rotation about the tilt axis.
    across = frame.points - run.mount.lever_arm
    expected = 0.065 * np.hypot(across[:, 0], across[:, 2])
    np.testing.assert_allclose(differences, expected, rtol=0.05)


def test_a_run_is_reproducible_from_its_seed(terrain):
    def image(seed):
        return ladar_run(seed, scene=terrain, count=2)[1].ranges

    assert image(5).tobytes() == image(5).tobytes()
    assert image(5).tobytes() != image(6).tobytes()
