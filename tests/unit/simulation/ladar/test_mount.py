import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.errors import InvalidInput
from scanlock.simulation.ladar.mount import PanTiltMount, TiltSweep

_PLAIN = PanTiltMount(
    lever_arm=(1.0, 0.2, 0.5), head_offset=(0.3, 0.0, 0.1), misalignment=(0.0, 0.0, 0.0),
    pan_zero=0.0, tilt_zero=0.0,
)  # fmt: skip


def test_zero_readings_point_straight_ahead_from_both_lever_arms():
    pose = _PLAIN.vehicle_from_sensor(0.0, 0.0)
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    np.testing.assert_allclose(pose.translation, [1.3, 0.2, 0.6])


def test_pan_is_to_the_left_and_tilt_upwards_about_the_axes():
    left = _PLAIN.vehicle_from_sensor(np.radians(90.0), 0.0)
    np.testing.assert_allclose(left.rotation[:, 0], [0.0, 1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(left.translation, [1.0, 0.5, 0.6], atol=1e-12)
    up = _PLAIN.vehicle_from_sensor(0.0, np.radians(30.0))
    np.testing.assert_allclose(up.rotation[:, 0], [np.sqrt(0.75), 0.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(
        up.translation, [1.0 + 0.3 * np.sqrt(0.75) - 0.05, 0.2, 0.5 + 0.15 + 0.1 * np.sqrt(0.75)]
    )
    # The tilt axis is panned too.
    both = _PLAIN.vehicle_from_sensor(np.radians(90.0), np.radians(30.0))
    np.testing.assert_allclose(both.rotation[:, 0], [0.0, np.sqrt(0.75), 0.5], atol=1e-12)


def test_the_pose_agrees_with_scipy_rotations():
    rng = np.random.default_rng(1)
    for _ in range(20):
        lever, offset, skew = rng.normal(size=(3, 3)) * [[1.0], [0.3], [0.05]]
        zeros, readings = rng.normal(0.0, 0.1, 2), rng.uniform(-0.5, 0.5, 2)
        mount = PanTiltMount(
            lever_arm=tuple(lever), head_offset=tuple(offset), misalignment=tuple(skew),
            pan_zero=zeros[0], tilt_zero=zeros[1],
        )  # fmt: skip
        pan, tilt = readings - zeros
        head = Rotation.from_euler("ZY", [pan, -tilt])
        pose = mount.vehicle_from_sensor(*readings)
        expected = (head * Rotation.from_rotvec(skew)).as_matrix()
        np.testing.assert_allclose(pose.rotation, expected, atol=1e-12)
        np.testing.assert_allclose(pose.translation, lever + head.apply(offset), atol=1e-12)


@pytest.mark.parametrize(
    ("pan", "tilt", "message"),
    [
        (0.0, np.radians(30.1), "tilt must be within"),
        (0.0, -np.radians(31.0), "tilt must be within"),
        (np.radians(91.0), 0.0, "pan must be within"),
        (np.nan, 0.0, "pan must be within"),
    ],
)
def test_readings_beyond_the_limits_are_refused(pan, tilt, message):
    with pytest.raises(InvalidInput, match=message):
        _PLAIN.vehicle_from_sensor(pan, tilt)


def test_readings_at_the_limits_are_accepted():
    for degrees in (-30.0, 30.0):
        _PLAIN.vehicle_from_sensor(0.0, np.deg2rad(degrees) * (1 + 1e-12))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"lever_arm": (0.0, 1.0)}, "lever_arm must be three finite numbers"),
        ({"head_offset": (0.0, np.nan, 0.0)}, "head_offset must be three finite numbers"),
        ({"misalignment": (np.inf, 0.0, 0.0)}, "misalignment must be three finite numbers"),
        ({"tilt_zero": np.nan}, "tilt_zero must be finite, got nan rad"),
        ({"tilt_limit": 0.0}, "tilt_limit must be positive, got 0.0 rad"),
    ],
)
def test_mount_settings_out_of_range_are_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        dataclasses.replace(_PLAIN, **change)


def test_a_tilt_is_constant_or_oscillates_about_its_mean():
    fixed = TiltSweep(pan=0.3, tilt=-0.2)
    assert {fixed.at(time) for time in (0.0, 1.7, 100.0)} == {(0.3, -0.2)}
    swinging = TiltSweep(tilt=-0.2, swing=0.1, period=4.0)
    tilts = [swinging.at(time)[1] for time in (0.0, 1.0, 2.0, 3.0, 4.0)]
    np.testing.assert_allclose(tilts, [-0.2, -0.1, -0.2, -0.3, -0.2], atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tilt": np.inf}, "tilt must be finite"),
        ({"swing": -0.1}, "swing must be at least"),
        ({"period": 0.0}, "period must be positive"),
    ],
)
def test_sweep_settings_out_of_range_are_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        TiltSweep(**change)
