import dataclasses

import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.simulation import (
    SENSORS,
    hdl_32e,
    hdl_64e,
    livox_avia,
    os0_128,
    os1_64,
    os1_128,
    vlp_16,
    vlp_32c,
)


def test_the_hdl_64e_has_two_blocks_of_beams():
    degrees = np.degrees(hdl_64e().elevations)
    assert (degrees[0], degrees[-1]) == pytest.approx((2.0, -24.8))
    upper, lower = -np.diff(degrees[:32]), -np.diff(degrees[32:])
    assert upper.mean() == pytest.approx(1 / 3, abs=0.01)
    assert lower.mean() == pytest.approx(0.515, abs=0.01)
    assert upper.min() > 0.2
    # Uneven like calibrated angles, but reproducible.
    assert np.ptp(upper) > 0.05
    assert hdl_64e() == hdl_64e()


@pytest.mark.parametrize(
    ("sensor", "beams", "top", "bottom"),
    [
        (hdl_32e(), 32, 10.67, -30.67),
        (os1_64(), 64, 16.6, -16.6),
        (vlp_16(), 16, 15.0, -15.0),
        (os1_128(), 128, 22.5, -22.5),
        (os0_128(), 128, 45.0, -45.0),
        (livox_avia(), 400, 38.6, -38.6),
    ],
)
def test_evenly_spaced_sensors_span_their_field_of_view(sensor, beams, top, bottom):
    degrees = np.degrees(sensor.elevations)
    np.testing.assert_allclose(degrees, np.linspace(top, bottom, beams), atol=1e-9)


def test_the_vlp_32c_has_dense_beams_near_the_horizon():
    degrees = np.degrees(vlp_32c().elevations)
    assert (len(degrees), degrees[0], degrees[-1]) == (32, pytest.approx(15), pytest.approx(-25))
    assert (np.diff(degrees) < 0).all()
    dense = np.diff(degrees[(degrees < 2) & (degrees > -4.1)])
    np.testing.assert_allclose(dense, -1 / 3, atol=1e-3)
    offsets, counts = np.unique(np.degrees(vlp_32c().azimuth_offsets).round(3), return_counts=True)
    assert dict(zip(offsets.tolist(), counts.tolist(), strict=True)) == {
        -4.2: 5, -1.4: 11, 1.4: 11, 4.2: 5,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("sensor", "points_per_second", "far"),
    [
        (vlp_16(), 288_000, 100.0),
        (vlp_32c(), 576_000, 200.0),
        (os1_128(), 1_310_720, 120.0),
        (os0_128(), 1_310_720, 50.0),
        (livox_avia(), 240_000, 190.0),
    ],
)
def test_pulses_and_range_are_those_of_the_data_sheet(sensor, points_per_second, far):
    assert sensor.beams * sensor.azimuth_steps * sensor.rate == points_per_second
    assert sensor.max_range == far
    assert sensor.detection(np.array([far + 1.0]), np.ones(1))[0] == 0.0


def test_a_sweep_of_part_of_a_turn_is_centred_straight_ahead():
    sensor = livox_avia()
    beams = sensor.directions()
    azimuth = np.degrees(np.arctan2(beams[:, 1], beams[:, 0]))
    step = 70.4 / sensor.azimuth_steps
    assert (azimuth[0], azimuth[-1]) == pytest.approx((35.2, -35.2 + step))
    assert np.median(azimuth) == pytest.approx(0.5 * step)


_SPINNING = sorted(set(SENSORS) - {"livox_avia"})


@pytest.mark.parametrize("name", sorted(SENSORS))
def test_a_sensor_has_the_name_of_its_function(name):
    assert SENSORS[name]().name == name


@pytest.mark.parametrize("name", _SPINNING)
def test_a_sweep_is_one_clockwise_revolution_that_begins_behind(name):
    sensor = SENSORS[name]()
    beams = sensor.directions().reshape(sensor.azimuth_steps, sensor.beams, 3)
    np.testing.assert_allclose(np.linalg.norm(beams, axis=2), 1.0, rtol=1e-12)
    np.testing.assert_allclose(
        np.arcsin(beams[..., 2]), np.broadcast_to(sensor.elevations, beams.shape[:2]), atol=1e-12
    )
    azimuth = np.arctan2(beams[..., 1], beams[..., 0]) - np.array(sensor.azimuth_offsets)
    steps = np.diff(np.unwrap(azimuth, axis=0), axis=0)
    np.testing.assert_allclose(steps, -2 * np.pi / sensor.azimuth_steps, atol=1e-9)
    np.testing.assert_allclose(np.cos(azimuth[0]), -1.0, atol=1e-12)
    times = sensor.firing_times()
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(sensor.period * (1 - 1 / sensor.azimuth_steps))
    np.testing.assert_allclose(np.cos(azimuth[sensor.azimuth_steps // 2]), 1.0, atol=1e-5)


def test_detection_falls_with_range_and_grazing_incidence():
    sensor = dataclasses.replace(hdl_64e(), dropout=0.0)
    ranges = np.linspace(1.0, 130.0, 400)
    facing = sensor.detection(ranges, np.ones(400))
    grazing = sensor.detection(ranges, np.full(400, 0.03))
    assert (np.diff(facing) <= 0).all()
    assert (grazing <= facing).all()
    assert facing[ranges < 100].min() == 1.0
    assert facing[ranges > 120.0].max() == 0.0
    # Pavement is detected up to about 50 m from the height of a car.
    pavement = sensor.detection(ranges, np.minimum(1.73 / ranges, 1.0))
    half = ranges[np.argmax((pavement < 0.5) & (ranges > 2))]
    assert 45.0 < half < 57.0
    assert sensor.detection(np.array([0.5]), np.ones(1))[0] == 0.0
    nothing = sensor.detection(np.array([np.inf]), np.zeros(1))
    assert nothing[0] == 0.0


def test_detection_without_fading_is_a_step():
    sensor = dataclasses.replace(os1_64(), fading=0.0, dropout=0.25, grazing=1.0)
    chances = sensor.detection(np.array([59.0, 61.0]), np.array([0.5, 0.5]))
    assert chances.tolist() == [0.75, 0.0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"elevations": ()}, "one entry per beam, got 0 and 64"),
        ({"azimuth_offsets": (0.0,)}, "one entry per beam, got 64 and 1"),
        ({"elevations": (np.nan,) * 64}, "must be finite"),
        ({"azimuth_steps": 0}, "azimuth_steps must be a whole number"),
        ({"rate": 0.0}, "rate must be positive, got 0.0 Hz"),
        ({"min_range": -1.0}, "min_range must be at least 0.0 m"),
        ({"max_range": 0.5}, "max_range must exceed min_range, got 0.5 <= 0.9 m"),
        ({"range_noise": -0.1}, "range_noise must be at least"),
        ({"grazing": -0.1}, "grazing must be at least"),
        ({"fading": 2.0}, "fading must lie between 0 and 1"),
        ({"dropout": -0.1}, "dropout must lie between 0 and 1"),
        ({"width": 0.0}, "width must be an angle above 0 and up to a full turn, got 0.0 rad"),
        ({"width": 7.0}, "width must be an angle above 0 and up to a full turn, got 7.0 rad"),
    ],
)
def test_sensor_settings_out_of_range_are_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        dataclasses.replace(hdl_64e(), **change)
