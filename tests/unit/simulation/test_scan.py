import dataclasses
import hashlib

import numpy as np
import pytest

from reference import ray_casting as reference
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.shapes import boxes, cones, ellipsoids
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.objects.surfaces import Surfaces
from scanlock.simulation.scan import simulate_scan
from scanlock.simulation.sensors import Sensor
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import World

_KINDS = ["box", "cone", "ellipsoid", "disc", "triangle"]
_TWIST = np.array([8.0, 0.5, -0.3, 0.1, -0.2, 0.6])
_POSE = Pose(exp_rotation(np.array([0.02, -0.03, 0.7])), np.array([1.0, -2.0, 1.7]))


def _sensor(**changes):
    """A small sensor without noise and lost returns by default."""
    settings = {
        "name": "small",
        "elevations": tuple(np.radians(np.linspace(15, -35, 12))),
        "azimuth_offsets": (0.0,) * 12,
        "azimuth_steps": 90,
        "rate": 10.0,
        "min_range": 0.5,
        "max_range": 60.0,
        "range_noise": 0.0,
        "grazing": 0.0,
        "fading": 0.0,
        "dropout": 0.0,
    }
    return Sensor(**(settings | changes))


def _things():
    return [
        boxes([12.0, 0, 2], [1, 6, 4], SurfaceClass.BUILDING).as_object(1),
        cones([[-6.0, 5, -1]], [[-6.0, 5, 6]], 0.6, 0.3, SurfaceClass.TRUNK).as_object(2),
        ellipsoids([-3.0, -9, 1], [3, 2, 2.5], SurfaceClass.SHRUB).as_object(3),
    ]


def _hills():
    return HeightField.sampled(
        lambda xy: 0.4 * np.sin(xy[:, 0] / 5) * np.cos(xy[:, 1] / 7), (-40, -40), (40, 40), 1.0
    )


def _world(**changes):
    return World.of(**({"surfaces": _things(), "ground": _hills()} | changes))


def _scan(world, sensor=None, *, pose=_POSE, seed=0, **options):
    return simulate_scan(world, sensor or _sensor(), pose, np.random.default_rng(seed), **options)


def _distance_to_surface(world, point, number):
    """Distance of a point from the surface of an object."""
    if number == 0:
        return abs(point[2] - world.ground.at(point[None])[0])
    rows = np.flatnonzero(world.surfaces.objects == number)
    distances = []
    for k in rows:
        row = world.surfaces.rows[k]
        local = reference.to_local(row, point)
        distances.append(abs(reference.gauge(_KINDS[world.surfaces.kinds[k]], row[12:], local)))
    return min(distances)


@pytest.mark.parametrize("twist", [None, _TWIST], ids=["at rest", "moving"])
def test_points_without_noise_are_on_their_labelled_surfaces(twist):
    world = _world()
    scan = _scan(world, twist=twist)
    classes = {0: SurfaceClass.GROUND, 1: SurfaceClass.BUILDING, 2: SurfaceClass.TRUNK,
               3: SurfaceClass.SHRUB}  # fmt: skip
    assert set(scan.objects) == set(classes)
    for point, label, number in zip(scan.in_world(), scan.labels, scan.objects, strict=True):
        assert label == classes[number]
        assert _distance_to_surface(world, point, number) < 1e-9


def test_the_exact_pose_aligns_two_scans():
    world = _world()
    other = Pose(exp_rotation(np.array([0.0, 0.05, -0.4])), np.array([3.0, 1.0, 2.0]))
    target, source = _scan(world), _scan(world, pose=other)
    target_from_source = target.pose.inverse() @ source.pose
    in_target = target_from_source.apply(source.points)
    for point, number in zip(target.pose.apply(in_target), source.objects, strict=True):
        assert _distance_to_surface(world, point, number) < 1e-9


def test_a_zero_twist_equals_a_sensor_at_rest():
    world = _world()
    still, zero = _scan(world), _scan(world, twist=np.zeros(6))
    assert still.points.tobytes() == zero.points.tobytes()
    assert still.start_pose == still.pose == still.end_pose
    assert np.array_equal(still.deskewed(), still.points)
    np.testing.assert_allclose(still.in_world(), _POSE.apply(still.points), atol=1e-12)


@pytest.mark.slow
def test_every_firing_of_a_moving_sensor_has_its_own_pose():
    world, sensor = _world(), _sensor()
    scan = _scan(world, sensor, twist=_TWIST)
    half = 0.5 * sensor.period
    assert scan.start_pose.distance(scan.pose)[0] > 0.3
    # The pose at the middle is half way between those at the start and the end.
    back = scan.pose.inverse() @ scan.start_pose
    ahead = scan.pose.inverse() @ scan.end_pose
    assert (back @ ahead).is_close(Pose.identity(), translation=1e-12, rotation=1e-12)
    # A ray from the pose at the time of firing hits the point.
    for k in np.linspace(0, len(scan) - 1, 20).astype(int):
        late = scan.times[k] - half
        steps = 1000
        pose = scan.pose
        for _ in range(steps):  # definition of a twist, integrated in small steps
            small = Pose.from_step(_TWIST * (late / steps))
            pose = pose @ small
        direction = scan.points[k] / np.linalg.norm(scan.points[k])
        hit = world.cast(
            pose.translation[None], (pose.rotation @ direction)[None], 0.0, np.zeros(1), 60.0
        )
        assert hit.distances[0] == pytest.approx(np.linalg.norm(scan.points[k]), abs=1e-3)


def test_a_moving_object_is_hit_at_its_position_at_each_firing():
    block = boxes([0.0, 0, 0], [1.0, 1, 1], SurfaceClass.CAR).as_object(5)
    path = np.array([[8.0, -50, 0], [8, 50, 0]])
    world = World.of((), None, [Mover(surfaces=block, path=path, start=40.0, speed=10.0)])
    pose = Pose(np.eye(3), np.zeros(3))
    # At time 1.05, the middle of the sweep, the centre of the object is at y = 0.5.
    scan = _scan(world, _sensor(azimuth_steps=7200), pose=pose, time=1.05)
    assert set(scan.labels) == {SurfaceClass.CAR}
    assert set(scan.objects) == {5}
    np.testing.assert_allclose(scan.points[:, 0], 7.0, atol=1e-9)
    # The clockwise sweep hits its left end first, and its right end after further motion.
    first, last = scan.times.min() - 0.05, scan.times.max() - 0.05
    assert scan.points[:, 1].max() == pytest.approx(1.5 + 10.0 * first, abs=0.01)
    assert scan.points[:, 1].min() == pytest.approx(-0.5 + 10.0 * last, abs=0.01)
    assert 10.0 * (last - first) > 0.04
    assert len(_scan(world, _sensor(max_range=20.0), pose=pose, time=100.0)) == 0


def test_an_empty_world_gives_an_empty_scan():
    scan = _scan(World.of())
    assert len(scan) == 0
    assert scan.points.shape == scan.deskewed().shape == scan.in_world().shape == (0, 3)
    assert scan.labels.shape == scan.objects.shape == scan.rings.shape == scan.times.shape == (0,)


def test_rings_and_times_match_the_directions_of_the_points():
    sensor = _sensor()
    scan = _scan(_world(), sensor)
    elevation = np.arcsin(scan.points[:, 2] / np.linalg.norm(scan.points, axis=1))
    np.testing.assert_allclose(elevation, np.array(sensor.elevations)[scan.rings], atol=1e-9)
    azimuth = np.arctan2(scan.points[:, 1], scan.points[:, 0])
    phase = (np.pi - azimuth) % (2 * np.pi) / (2 * np.pi)
    differences = (phase - scan.times / sensor.period + 0.5) % 1.0 - 0.5
    np.testing.assert_allclose(differences, 0.0, atol=1e-9)
    assert (np.diff(scan.times) >= 0).all()


def test_range_noise_is_along_the_beam_with_the_given_deviation():
    world = _world()
    exact, noisy = _scan(world), _scan(world, _sensor(range_noise=0.05), seed=4)
    a, b = np.linalg.norm(exact.points, axis=1), np.linalg.norm(noisy.points, axis=1)
    np.testing.assert_allclose(exact.points / a[:, None], noisy.points / b[:, None], atol=1e-12)
    assert (b - a).std() == pytest.approx(0.05, rel=0.1)
    assert abs((b - a).mean()) < 0.01


def test_dropout_and_surface_losses_have_the_given_rates():
    whole = len(_scan(_world()))
    assert len(_scan(_world(), _sensor(dropout=0.3))) == pytest.approx(0.7 * whole, rel=0.1)
    clear = boxes([12.0, 0, 2], [1, 6, 4], SurfaceClass.BUILDING)
    glass = boxes([12.0, 0, 2], [1, 6, 4], SurfaceClass.BUILDING, loss=0.75)
    kept = len(_scan(World.of(glass))) / len(_scan(World.of(clear)))
    assert kept == pytest.approx(0.25, abs=0.12)
    assert len(_scan(World.of(boxes([0.0, 0, 0], [0.25, 0.25, 0.25], SurfaceClass.CAR)),
                     pose=Pose.identity())) == 0  # fmt: skip


def test_noise_does_not_depend_on_the_other_objects():
    noisy = _sensor(range_noise=0.05, dropout=0.2)
    both = _scan(_world(), noisy)
    alone = _scan(_world(surfaces=_things()[:1], ground=None), noisy)
    common = {tuple(point) for point in both.points[both.objects == 1]}
    assert {tuple(point) for point in alone.points} >= common
    assert len(common) > 50


def _digest(scan):
    digest = hashlib.sha256()
    for array in (scan.points, scan.labels, scan.objects, scan.rings, scan.times, scan.twist):
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def test_the_same_seed_gives_the_same_bytes():
    noisy = _sensor(range_noise=0.05, dropout=0.2)
    assert _digest(_scan(_world(), noisy)) == _digest(_scan(_world(), noisy))
    assert _digest(_scan(_world(), noisy)) != _digest(_scan(_world(), noisy, seed=1))


def test_arrays_of_a_scan_are_read_only():
    scan = _scan(_world())
    for field in dataclasses.fields(scan):
        value = getattr(scan, field.name)
        assert not isinstance(value, np.ndarray) or not value.flags.writeable


def test_the_nearest_of_terrain_static_and_moving_objects_is_hit():
    far = boxes([20.0, 0, 0], [1, 3, 3], SurfaceClass.BUILDING).as_object(1)
    near = boxes([0.0, 0, 0], [1, 3, 3], SurfaceClass.CAR).as_object(2)
    path = np.array([[10.0, 0, 0], [11.0, 0, 0]])
    origin, ahead = np.zeros((1, 3)), np.array([[1.0, 0, 0]])
    slope = HeightField.sampled(lambda xy: xy[:, 0] - 5.0, (-9, -9), (9, 9), 1.0)
    parked = Mover(surfaces=near, path=path, start=0.0, speed=0.0)
    for ground, movers, expected in [
        (None, (), (19.0, SurfaceClass.BUILDING, 1)),
        (None, (parked,), (9.0, SurfaceClass.CAR, 2)),
        (slope, (parked,), (5.0, SurfaceClass.GROUND, 0)),
    ]:
        hit = World.of(far, ground, movers).cast(origin, ahead, 0.0, np.zeros(1), 50.0)
        assert (hit.distances[0], hit.labels[0], hit.objects[0]) == pytest.approx(expected)


def test_a_world_is_built_from_surfaces_or_lists_of_them():
    joined = World.of(Surfaces.joined(_things()))
    assert np.array_equal(joined.surfaces.rows, World.of(_things()).surfaces.rows)


@pytest.mark.parametrize("twist", [np.zeros(3), np.full(6, np.nan)])
def test_invalid_twists_are_refused(twist):
    with pytest.raises(InvalidInput, match="twist must be six finite numbers"):
        _scan(_world(), twist=twist)


def test_rays_of_inconsistent_shapes_are_refused():
    with pytest.raises(InvalidInput, match="must have shape"):
        World.of().cast(np.zeros((2, 3)), np.zeros((2, 3)), 0.0, np.zeros(1), 10.0)
    with pytest.raises(InvalidInput, match="max_range must be positive"):
        World.of().cast(np.zeros((1, 3)), np.zeros((1, 3)), 0.0, np.zeros(1), 0.0)
