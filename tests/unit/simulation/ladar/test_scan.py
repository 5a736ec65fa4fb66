import dataclasses
import hashlib

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.drive import Drive
from scanlock.simulation.ladar.mount import PanTiltMount, TiltSweep
from scanlock.simulation.ladar.scan import LadarScan, simulate_frame
from scanlock.simulation.ladar.sensor import FacetLadar, points_from_ranges, ranges_from_points
from scanlock.simulation.ladar.sequence import AHEAD_AND_DOWN, LadarSequence, ladar_run
from scanlock.simulation.motion import carried
from scanlock.simulation.objects.shapes import boxes, ellipsoids
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import World

_EXACT = FacetLadar(
    rows=16, columns=45, facet_offsets=(0.002, -0.001, 0.0, 0.003, -0.002, 0.001, 0.0, -0.003),
    range_noise=0.0, range_resolution=0.0, grazing=0.0, fading=0.0, dropout=0.0, plant_loss=0.0,
    facet_loss=0.0,
)  # fmt: skip
_MOUNT = PanTiltMount()
_POSE = Pose(exp_rotation(np.array([0.05, -0.04, 0.7])), np.array([1.0, -2.0, 1.5]))
_TWIST = np.array([8.0, 0.5, -0.3, 0.1, -0.6, 0.4])
_TILT = np.radians(-12.0)


def _slope(places):
    return 0.1 * places[:, 0] - 0.05 * places[:, 1]


def _world(label=SurfaceClass.SHRUB):
    """A slope, which a height field represents exactly, and a ball on it."""
    ground = HeightField.sampled(_slope, (-90, -90), (90, 90), 3.0)
    return World.of(ellipsoids([6.5, 3.0, 1.0], [1.5, 1.5, 1.5], label).as_object(1), ground)


def _frame(ladar=_EXACT, *, world=None, seed=0, **options):
    rng = np.random.default_rng(seed)
    options = {"tilt": _TILT} | options
    return simulate_frame(world or _world(), ladar, _MOUNT, _POSE, rng, **options)


def _digest(scan):
    digest = hashlib.sha256()
    for field in dataclasses.fields(scan):
        value = getattr(scan, field.name)
        if isinstance(value, np.ndarray):
            digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()


@pytest.mark.parametrize("twist", [None, _TWIST], ids=["at rest", "moving"])
def test_points_without_noise_are_on_their_labelled_surfaces(twist):
    scan = _frame(twist=twist)
    assert set(scan.labels) == {SurfaceClass.GROUND, SurfaceClass.SHRUB}
    assert len(scan) > 500
    world = scan.in_world()
    ground = scan.labels == SurfaceClass.GROUND
    np.testing.assert_allclose(world[ground, 2], _slope(world[ground]), atol=1e-9)
    radii = np.linalg.norm(world[~ground] - [6.5, 3.0, 1.0], axis=1)
    np.testing.assert_allclose(radii, 1.5, atol=1e-9)


def test_range_image_and_points_are_consistent():
    scan = _frame(twist=_TWIST, pan=0.2)
    points = points_from_ranges(scan.ranges, _EXACT, _MOUNT, pan=scan.pan, tilt=scan.tilt)
    np.testing.assert_array_equal(points[np.isfinite(scan.ranges)], scan.points)
    image = ranges_from_points(scan.points, _EXACT, _MOUNT, pan=scan.pan, tilt=scan.tilt)
    np.testing.assert_allclose(image, scan.ranges, rtol=1e-12)
    row, column = np.nonzero(np.isfinite(scan.ranges))
    np.testing.assert_array_equal(scan.rings, row)
    np.testing.assert_allclose(scan.times, _EXACT.firing_times()[row // 2, column])


def test_each_beam_starts_at_the_pose_of_its_time_of_firing():
    scan, world = _frame(twist=_TWIST, pan=-0.3), _world()
    eye = _MOUNT.vehicle_from_sensor(-0.3, _TILT)
    beams = _EXACT.directions()[np.isfinite(scan.ranges)]
    metres = _EXACT.range_scale * scan.ranges[np.isfinite(scan.ranges)] + _EXACT.range_offset
    for k in range(0, len(scan), 97):
        pose = carried(scan.pose, _TWIST, float(scan.times[k]) - 0.05) @ eye
        hit = world.cast(
            pose.translation[None], beams[None, k] @ pose.rotation.T, 0.0, np.zeros(1), 60.0
        )
        assert hit.distances[0] == pytest.approx(metres[k], abs=1e-9)


def test_the_exact_pose_aligns_two_frames():
    world = _world()
    ahead = carried(_POSE, _TWIST, 0.1)
    target = _frame(world=world, twist=_TWIST)
    source = simulate_frame(
        world, _EXACT, _MOUNT, ahead, np.random.default_rng(0), tilt=-0.3, twist=_TWIST
    )
    target_from_source = target.pose.inverse() @ source.pose
    moved = target.pose.apply(target_from_source.apply(source.deskewed()))
    ground = source.labels == SurfaceClass.GROUND
    np.testing.assert_allclose(moved[ground, 2], _slope(moved[ground]), atol=1e-9)


def test_panning_left_moves_an_object_on_the_left_to_the_centre_of_the_image():
    block = boxes([0.0, 8.0, 1.5], [3.0, 0.5, 1.0], SurfaceClass.ROCK).as_object(1)
    pose = Pose(np.eye(3), np.array([0.0, 0.0, 1.5]))
    middles = {}
    for pan in (np.radians(60.0), np.radians(89.0)):
        scan = simulate_frame(
            World.of(block), _EXACT, _MOUNT, pose, np.random.default_rng(0), pan=pan
        )
        middles[pan] = np.nonzero(np.isfinite(scan.ranges))[1].mean()
        # In the frame of the vehicle, the block does not move.
        np.testing.assert_allclose(scan.points[:, 1], 7.5, atol=1e-9)
    assert list(middles.values()) == pytest.approx([22.0 - 30.0 / 2, 22.0], abs=4.0)


def test_an_empty_world_gives_an_empty_image():
    scan = _frame(world=World.of())
    assert len(scan) == 0
    assert scan.points.shape == scan.deskewed().shape == (0, 3)
    assert np.isnan(scan.ranges).all()


def test_noise_and_resolution_have_the_given_sizes():
    clean = _frame()
    noisy = _frame(dataclasses.replace(_EXACT, range_noise=0.04), seed=2)
    noise = noisy.ranges - clean.ranges
    assert np.nanstd(noise) == pytest.approx(0.04, rel=0.1)
    assert abs(np.nanmean(noise)) < 0.006
    coarse = _frame(dataclasses.replace(_EXACT, range_resolution=0.25)).ranges
    steps = coarse[np.isfinite(coarse)] / 0.25
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-9)


def test_empty_facets_have_the_given_ratio_and_span_two_rows():
    down = np.radians(-25.0)
    ladar = dataclasses.replace(_EXACT, facet_loss=0.25)
    whole = np.isfinite(_frame(tilt=down).ranges)
    assert whole.any(axis=1).all()
    lost = []
    for seed in range(60):
        seen = np.isfinite(_frame(ladar, seed=seed, tilt=down).ranges)
        empty = ~seen.any(axis=1)
        np.testing.assert_array_equal(empty[::2], empty[1::2])
        np.testing.assert_array_equal(seen[~empty], whole[~empty])
        lost.append(empty.mean())
    assert np.mean(lost) == pytest.approx(0.25, abs=0.06)


@pytest.mark.parametrize(
    ("label", "kept"),
    [(SurfaceClass.SHRUB, 0.4), (SurfaceClass.GRASS, 0.4), (SurfaceClass.ROCK, 1)],
)
def test_plant_loss_applies_to_plants_only(label, kept):
    world = _world(label)
    ladar = dataclasses.replace(_EXACT, columns=180, plant_loss=0.6)
    full = _frame(dataclasses.replace(ladar, plant_loss=0.0), world=world)
    thin = _frame(ladar, world=world)
    share = (thin.labels == label).sum() / (full.labels == label).sum()
    assert share == pytest.approx(kept, abs=0.12 if kept < 1 else 0.0)
    assert (thin.labels == SurfaceClass.GROUND).sum() == (full.labels == SurfaceClass.GROUND).sum()


def test_the_same_seed_gives_the_same_bytes_and_read_only_frames():
    noisy = FacetLadar(facet_loss=0.3)
    assert _digest(_frame(noisy)) == _digest(_frame(noisy))
    assert _digest(_frame(noisy)) != _digest(_frame(noisy, seed=1))
    scan = _frame(noisy)
    for field in dataclasses.fields(scan):
        value = getattr(scan, field.name)
        assert not isinstance(value, np.ndarray) or not value.flags.writeable


def test_invalid_twists_and_tilts_are_refused():
    with pytest.raises(InvalidInput, match="twist must be six finite numbers"):
        _frame(twist=np.zeros(3))
    with pytest.raises(InvalidInput, match="tilt must be within"):
        _frame(tilt=-0.6)


def _sequence(seed=4, **options):
    poses = tuple(carried(_POSE, _TWIST, 0.1 * k) for k in range(6))
    drive = Drive(poses, np.tile(_TWIST, (6, 1)), 0.1 * np.arange(6))
    options = {"ladar": FacetLadar(), "mount": _MOUNT} | options
    return LadarSequence(world=_world(), drive=drive, seed=seed, **options)


def test_a_frame_does_not_depend_on_the_order_of_access():
    sequence = _sequence()
    third = _digest(sequence[3])
    assert len(sequence) == 6
    assert _digest(list(sequence)[3]) == third
    assert _digest(sequence[-3]) == third
    assert _digest(next(sequence.scans([3]))) == third
    assert _digest(_sequence(seed=5)[3]) != third


def test_frames_have_the_pose_twist_and_tilt_of_their_time():
    look = TiltSweep(pan=0.1, tilt=-0.2, swing=0.1, period=1.0)
    for k, scan in enumerate(_sequence(look=look)):
        assert isinstance(scan, LadarScan)
        assert scan.pose == carried(_POSE, _TWIST, 0.1 * k)
        assert np.array_equal(scan.twist, _TWIST)
        assert (scan.time, scan.period) == (pytest.approx(0.1 * k), 0.1)
        assert (scan.pan, scan.tilt) == look.at(scan.time)
    assert {scan.tilt for scan in _sequence()} == {AHEAD_AND_DOWN.tilt}


def test_a_missing_frame_is_an_index_error():
    for index in (6, -7):
        with pytest.raises(IndexError, match=f"frame {index} of a sequence of 6"):
            _sequence()[index]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"seed": -1}, "seed must be a whole number of at least 0"),
        ({"seed": 1, "speed": 0.0}, "speed must be positive, got 0.0 m/s"),
    ],
)
def test_invalid_runs_are_refused(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        ladar_run(**arguments)
