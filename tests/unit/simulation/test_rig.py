from dataclasses import replace

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation import Mount, Rig, boxes, livox_avia, simulate_rig, vlp_16
from scanlock.simulation.objects.surface_class import SurfaceClass
from scanlock.simulation.terrain.height_field import HeightField
from scanlock.simulation.world import World

_EXACT = {"range_noise": 0.0, "dropout": 0.0, "fading": 0.0}
_ROUND = replace(vlp_16(), **_EXACT, azimuth_steps=180)
_NARROW = replace(
    livox_avia(), **_EXACT, azimuth_steps=40, elevations=(0.0,), azimuth_offsets=(0.0,)
)


@pytest.fixture
def hall():
    walls = boxes(
        [[8.0, 0, 2], [-8.0, 0, 2], [0, 6.0, 2], [0, -6.0, 2]],
        [[0.1, 6, 2], [0.1, 6, 2], [8, 0.1, 2], [8, 0.1, 2]],
        SurfaceClass.BUILDING,
    )  # fmt: skip
    return World.of(walls, HeightField.level(20.0))


def _on_surfaces(points):
    x, y = np.abs(points[:, :2]).T
    on_wall = (np.abs(x - 7.9) < 1e-6) | (np.abs(y - 5.9) < 1e-6)
    return on_wall | (np.abs(points[:, 2]) < 1e-6)


@pytest.mark.parametrize(
    "rig",
    [
        Rig.looking_apart(_NARROW, np.radians(50.0)),
        Rig.tilted_apart(_ROUND, np.radians(30.0)),
        Rig.stacked(_ROUND, _NARROW, yaw=0.4),
    ],
)
def test_the_extrinsic_maps_every_scan_into_the_frame_of_the_rig(rig, hall):
    pose = Pose.from_step(np.array([1.0, -0.5, 1.5, 0.02, -0.03, 0.7]))
    scans = simulate_rig(hall, rig, pose, np.random.default_rng(0))
    assert len(scans) == 2
    for scan, mount in zip(scans, rig.mounts, strict=True):
        assert len(scan) > 20
        assert scan.pose.is_close(pose @ mount.rig_from_sensor, translation=1e-9, rotation=1e-9)
        points = pose.apply(mount.rig_from_sensor.apply(scan.points))
        assert _on_surfaces(points).all()


def _between(rig):
    first, second = (mount.rig_from_sensor for mount in rig.mounts)
    return first.inverse() @ second


def test_sensors_look_apart_by_the_given_angle():
    for rig, axis in (
        (Rig.looking_apart(_NARROW, 0.9), np.array([1.0, 0, 0])),
        (Rig.tilted_apart(_ROUND, 0.45), np.array([0, 0, 1.0])),
        (Rig.stacked(_ROUND, _NARROW, yaw=0.9), np.array([1.0, 0, 0])),
    ):
        angle = np.arccos(axis @ _between(rig).rotation @ axis)
        assert angle == pytest.approx(0.9)


def test_sensors_that_look_apart_are_beside_each_other_and_look_outwards():
    left, right = Rig.looking_apart(_NARROW, 1.0).mounts
    assert left.rig_from_sensor.translation[1] > 0 > right.rig_from_sensor.translation[1]
    assert left.rig_from_sensor.rotation[1, 0] > 0 > right.rig_from_sensor.rotation[1, 0]
    left, right = Rig.tilted_apart(_ROUND, 0.5).mounts
    # The axis of the left sensor is tilted to the left.
    assert left.rig_from_sensor.rotation[1, 2] > 0 > right.rig_from_sensor.rotation[1, 2]
    lower, upper = Rig.stacked(_ROUND, _NARROW).mounts
    assert lower.rig_from_sensor.translation[2] < upper.rig_from_sensor.translation[2]


def test_a_rig_without_sensors_is_refused():
    with pytest.raises(InvalidInput, match="mounts must contain at least one sensor"):
        Rig(mounts=())
    single = Rig(mounts=(Mount(sensor=_ROUND, rig_from_sensor=Pose.identity()),))
    assert len(single.mounts) == 1
