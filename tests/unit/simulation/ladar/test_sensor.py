import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.errors import InvalidInput
from scanlock.simulation.ladar.mount import PanTiltMount
from scanlock.simulation.ladar.sensor import FacetLadar, points_from_ranges, ranges_from_points

_LADAR = FacetLadar()
_LEVEL = dataclasses.replace(_LADAR, facet_offsets=(0.0,) * 16)


def _image(seed):
    """Random readings, with a tenth of the pixels and one facet empty."""
    rng = np.random.default_rng(seed)
    ranges = rng.uniform(1.0, 60.0, (32, 180))
    ranges[rng.random(ranges.shape) < 0.1] = np.nan
    ranges[6:8] = np.nan
    return ranges


def _mount(seed):
    rng = np.random.default_rng(seed)
    lever, offset, skew = rng.normal(size=(3, 3)) * [[1.0], [0.3], [0.02]]
    return PanTiltMount(
        lever_arm=tuple(lever), head_offset=tuple(offset), misalignment=tuple(skew),
        pan_zero=rng.normal(0.0, 0.02), tilt_zero=rng.normal(0.0, 0.02),
    )  # fmt: skip


def test_the_image_has_the_size_of_the_paper():
    assert _LADAR.directions().shape == (32, 180, 3)
    assert (_LADAR.facets, _LADAR.rows_per_facet) == (16, 2)
    up, left = np.degrees(_LEVEL.elevations()), np.degrees(_LEVEL.azimuths())
    np.testing.assert_allclose(np.diff(up), -20.0 / 32.0)
    np.testing.assert_allclose(np.diff(left), -90.0 / 180.0)
    np.testing.assert_allclose([up.mean(), left.mean()], 0.0, atol=1e-12)
    # From limit to limit, the platform covers 80 degrees of elevation.
    limit = np.degrees(PanTiltMount().tilt_limit)
    assert (up[0] + limit) - (up[-1] - limit) + 20.0 / 32.0 == pytest.approx(80.0)


def test_the_first_pixel_is_at_the_top_left():
    beams = _LADAR.directions()
    np.testing.assert_allclose(np.linalg.norm(beams, axis=2), 1.0, rtol=1e-12)
    assert beams[0, 0, 1] > 0.6 > -0.6 > beams[0, -1, 1]
    assert beams[0, 90, 2] > 0.15 > -0.15 > beams[-1, 90, 2]
    assert (beams[..., 0] > 0.6).all()


def test_each_facet_has_its_own_elevation_offset():
    offsets = _LADAR.elevations() - _LEVEL.elevations()
    np.testing.assert_allclose(offsets[::2], offsets[1::2], atol=1e-12)
    np.testing.assert_allclose(offsets[::2], _LADAR.facet_offsets, atol=1e-12)
    assert len(set(_LADAR.facet_offsets)) > 5


def test_facets_fire_consecutively_within_the_frame():
    times = _LADAR.firing_times()
    assert times.shape == (16, 180)
    np.testing.assert_allclose(np.diff(times.ravel()), 0.1 / (16 * 180))
    assert times[0, 0] == 0.0
    assert times[-1, -1] < _LADAR.frame_time <= 1.0 / _LADAR.rate


@pytest.mark.parametrize("seed", range(5))
def test_ranges_round_trip_through_points(seed):
    ranges, mount = _image(seed), _mount(seed)
    pan, tilt = np.random.default_rng(seed).uniform(-0.5, 0.5, 2)
    points = points_from_ranges(ranges, _LADAR, mount, pan=pan, tilt=tilt)
    back = ranges_from_points(points, _LADAR, mount, pan=pan, tilt=tilt)
    np.testing.assert_allclose(back, ranges, rtol=1e-12)
    np.testing.assert_array_equal(np.isnan(back), np.isnan(ranges))
    # Neither the order of the points nor NaN among them matters.
    shuffled = np.random.default_rng(seed).permutation(points.reshape(-1, 3))
    np.testing.assert_array_equal(
        ranges_from_points(shuffled, _LADAR, mount, pan=pan, tilt=tilt), back
    )


def test_points_round_trip_through_ranges():
    mount = _mount(9)
    points = points_from_ranges(_image(9), _LADAR, mount, pan=0.1, tilt=-0.3)
    ranges = ranges_from_points(points, _LADAR, mount, pan=0.1, tilt=-0.3)
    again = points_from_ranges(ranges, _LADAR, mount, pan=0.1, tilt=-0.3)
    np.testing.assert_allclose(again, points, atol=1e-11)


def test_points_agree_with_scipy_rotations():
    ranges, mount = _image(3), _mount(3)
    pan, tilt = 0.2, -0.25
    points = points_from_ranges(ranges, _LADAR, mount, pan=pan, tilt=tilt)
    head = Rotation.from_euler("ZY", [pan - mount.pan_zero, mount.tilt_zero - tilt])
    skew = Rotation.from_rotvec(mount.misalignment)
    for row, column in ((0, 0), (5, 179), (17, 90), (31, 30)):
        up = np.radians(20.0) * (15.5 - row) / 32 + _LADAR.facet_offsets[row // 2]
        left = np.radians(90.0) * (89.5 - column) / 180
        beam = Rotation.from_euler("ZY", [left, -up]).apply([1.0, 0.0, 0.0])
        metres = 0.12 + 1.002 * ranges[row, column]
        expected = mount.lever_arm + head.apply(mount.head_offset + skew.apply(metres * beam))
        np.testing.assert_allclose(points[row, column], expected, atol=1e-12)


def test_invalid_readings_give_nan_points():
    ranges = np.full((32, 180), 5.0)
    ranges[0, :4] = [0.0, -1.0, np.nan, np.inf]
    points = points_from_ranges(ranges, _LADAR, PanTiltMount(), pan=0.0, tilt=0.0)
    assert np.isnan(points[0, :4]).all()
    assert np.isfinite(points[0, 4:]).all()
    assert np.isfinite(points[1:]).all()


def test_a_pixel_has_its_nearest_point_and_outside_points_are_ignored():
    mount = PanTiltMount()
    beams = mount.vehicle_from_sensor(0.0, 0.0)
    beam = _LADAR.directions()[10, 20]
    behind, above = np.array([-5.0, 0.0, 0.0]), np.array([3.0, 0.0, 3.0])
    points = beams.apply(np.array([9.0 * beam, 4.0 * beam, 6.0 * beam, behind, above]))
    image = ranges_from_points(points, _LADAR, mount, pan=0.0, tilt=0.0)
    assert np.argwhere(np.isfinite(image)).tolist() == [[10, 20]]
    assert image[10, 20] == pytest.approx((4.0 - 0.12) / 1.002)


def test_another_calibration_gives_other_points():
    ranges, mount = _image(1), PanTiltMount()
    right = points_from_ranges(ranges, _LADAR, mount, pan=0.0, tilt=0.0)
    for ladar, other in (
        (dataclasses.replace(_LADAR, range_offset=0.0), mount),
        (_LEVEL, mount),
        (_LADAR, dataclasses.replace(mount, tilt_zero=0.0)),
    ):
        wrong = points_from_ranges(ranges, ladar, other, pan=0.0, tilt=0.0)
        differences = np.linalg.norm(wrong - right, axis=2)
        assert np.nanmax(differences) > 0.03


@pytest.mark.parametrize("shape", [(180, 32), (32 * 180,), (32, 180, 1)])
def test_an_image_of_another_shape_is_refused(shape):
    with pytest.raises(InvalidInput, match=r"ranges must have shape \(32, 180\)"):
        points_from_ranges(np.ones(shape), _LADAR, PanTiltMount(), pan=0.0, tilt=0.0)


def test_readings_undo_the_calibration_to_the_resolution():
    metres = np.linspace(1.0, 60.0, 1000)
    fine = dataclasses.replace(_LADAR, range_resolution=0.0)
    np.testing.assert_allclose(1.002 * fine.readings(metres) + 0.12, metres, rtol=1e-12)
    coarse = _LADAR.readings(metres)
    assert np.abs(coarse - fine.readings(metres)).max() <= 0.5 * 0.02 + 1e-12
    np.testing.assert_allclose(coarse / 0.02, np.rint(coarse / 0.02), atol=1e-9)


def test_returns_are_lost_far_away_at_grazing_incidence_and_too_near():
    ladar = dataclasses.replace(_LADAR, dropout=0.0)
    ranges = np.linspace(0.1, 80.0, 800)
    facing, grazing = (ladar.detection(ranges, np.full(800, c)) for c in (1.0, 0.05))
    assert (facing[ranges < 1.0] == 0.0).all()
    assert (np.diff(facing[ranges >= 1.0]) <= 0).all()
    assert (grazing <= facing).all()
    assert facing[(ranges > 1.0) & (ranges < 48.0)].min() == 1.0
    assert facing[ranges > 60.0].max() == 0.0
    # Ground under a sensor at 1.8 m fades between 24 and 33 m.
    ground = ladar.detection(ranges, np.minimum(1.8 / ranges, 1.0))
    assert ground[np.searchsorted(ranges, 22.0)] == 1.0
    assert ground[np.searchsorted(ranges, 35.0)] == 0.0
    sharp = dataclasses.replace(ladar, fading=0.0, grazing=0.0)
    np.testing.assert_array_equal(
        sharp.detection(np.array([59.9, 60.1, np.inf]), np.ones(3)), [1.0, 0.0, 0.0]
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rows": 1, "facet_offsets": (0.0,)}, "rows must be a whole number of at least 2"),
        ({"columns": 0}, "columns must be a whole number of at least 2"),
        ({"facet_offsets": (0.0,) * 15}, "rows be divisible by their number, got 15 for 32 rows"),
        ({"facet_offsets": ()}, "got 0 for 32 rows"),
        ({"facet_offsets": (0.0, 0.03) * 8}, "keep the rows in descending order"),
        ({"facet_offsets": (np.nan,) * 16}, "keep the rows in descending order"),
        ({"width": 0.0}, "width must be positive"),
        ({"rate": -1.0}, "rate must be positive"),
        ({"rate": 20.0}, "frame_time must be at most 0.05 s at 20.0 frames per second"),
        ({"min_range": 60.0}, "max_range must exceed min_range"),
        ({"range_noise": -0.1}, "range_noise must be at least"),
        ({"range_scale": 0.0}, "range_scale must be positive"),
        ({"range_offset": np.nan}, "range_offset must be finite"),
        ({"plant_loss": 1.1}, "plant_loss must lie between 0 and 1"),
    ],
)
def test_a_ladar_out_of_range_is_refused(change, message):
    with pytest.raises(InvalidInput, match=message):
        dataclasses.replace(_LADAR, **change)
