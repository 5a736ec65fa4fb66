import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.models.gaussians import unpacked
from scanlock.models.sensor_noise import SensorNoise, polar_jacobian, traces


def _cartesian(polar):
    r, azimuth, elevation = polar
    horizontal = r * np.cos(elevation)
    return np.array(
        [horizontal * np.cos(azimuth), horizontal * np.sin(azimuth), r * np.sin(elevation)]
    )


def _polar(rng, count):
    return np.column_stack(
        [
            rng.uniform(0.5, 80.0, count),
            rng.uniform(-7.0, 7.0, count),
            rng.uniform(-1.4, 1.4, count),
        ]
    )


def test_the_jacobian_matches_finite_differences():
    polar = _polar(np.random.default_rng(0), 50)
    jacobians = polar_jacobian(np.array([_cartesian(row) for row in polar]))
    h = 1e-6
    for row, jacobian in zip(polar, jacobians, strict=True):
        columns = [(_cartesian(row + h * e) - _cartesian(row - h * e)) / (2 * h) for e in np.eye(3)]
        np.testing.assert_allclose(jacobian, np.column_stack(columns), atol=1e-7)


@pytest.mark.slow
def test_the_covariance_matches_that_of_many_noisy_returns():
    noise = SensorNoise(range_deviation=0.03, azimuth_deviation=2e-3, elevation_deviation=1e-3)
    rng = np.random.default_rng(1)
    for polar in _polar(rng, 4):
        deviations = [0.03, 2e-3, 1e-3]
        returns = np.array(
            [_cartesian(p) for p in polar + rng.normal(0.0, deviations, (20_000, 3))]
        )
        found = unpacked(noise.covariances(_cartesian(polar)[None]))[0]
        np.testing.assert_allclose(found, np.cov(returns.T), atol=0.05 * found.max())


def test_every_covariance_is_invertible():
    points = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 5.0], [0.0, 0.0, -5.0], [30.0, 0.0, 0.0]])
    for noise in (SensorNoise(), SensorNoise(azimuth_deviation=0.0, elevation_deviation=0.0)):
        full = unpacked(noise.covariances(points))
        np.testing.assert_array_equal(full, full.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(full).min() > 0.0
        np.testing.assert_allclose(full[0], 0.02**2 * np.eye(3))


def test_only_angular_noise_grows_with_range():
    near, far = traces(SensorNoise().covariances(np.array([[2.0, 0, 0], [80.0, 0, 0]])))
    np.testing.assert_allclose(near, 0.02**2 + 2 * (2.0 * 6e-4) ** 2, rtol=1e-5)
    np.testing.assert_allclose(far, 0.02**2 + 2 * (80.0 * 6e-4) ** 2, rtol=1e-5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"range_deviation": 0.0}, "range_deviation must be positive, got 0.0 m"),
        ({"azimuth_deviation": -1.0}, "azimuth_deviation must be at least 0.0 rad"),
        ({"elevation_deviation": np.nan}, "elevation_deviation must be at least 0.0 rad"),
    ],
)
def test_invalid_settings_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        SensorNoise(**settings)
