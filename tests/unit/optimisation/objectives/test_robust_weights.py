import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.optimisation.objectives.robust_weights import TUNING, RobustWeights

_losses = pytest.mark.parametrize("loss", ["huber", "cauchy", "geman-mcclure", "tukey", "welsch"])


@pytest.mark.parametrize(
    ("loss", "at_half", "at_two"),
    [
        ("none", 1.0, 1.0),
        ("huber", 1.0, 0.5),
        ("cauchy", 0.8, 0.2),
        ("geman-mcclure", 0.64, 0.04),
        ("tukey", 0.5625, 0.0),
        ("welsch", np.exp(-0.25), np.exp(-4.0)),
    ],
)
def test_weights_follow_their_definitions(loss, at_half, at_two):
    weights = RobustWeights(loss=loss, scale=3.0).weights(np.array([0.0, 1.5, -1.5, 6.0]))
    np.testing.assert_allclose(weights, [1.0, at_half, at_half, at_two], rtol=1e-14)


@_losses
def test_the_tuning_keeps_95_percent_of_the_efficiency(loss):
    # Asymptotic efficiency of the M-estimator with influence r w(r) on Gaussian residuals.
    r = np.linspace(-10.0, 10.0, 100_001)
    density = np.exp(-0.5 * r * r)
    density /= density.sum()
    influence = r * RobustWeights(loss=loss, scale=TUNING[loss]).weights(r)
    slope = np.gradient(influence, r)
    efficiency = (slope @ density) ** 2 / (influence**2 @ density)
    np.testing.assert_allclose(efficiency, 0.95, atol=1e-4)


@_losses
def test_the_estimated_scale_resists_outliers(loss):
    residuals = np.random.default_rng(0).normal(0.0, 0.2, 4001)
    settings = RobustWeights(loss=loss)
    clean = settings.scale_for(residuals)
    np.testing.assert_allclose(clean, 0.2 * TUNING[loss], rtol=0.05)
    with_outliers = np.append(residuals, np.full(400, 50.0))
    np.testing.assert_allclose(settings.scale_for(with_outliers), clean, rtol=0.2)
    assert settings.weights(with_outliers)[-1] < 0.02


@_losses
def test_residuals_of_zero_have_weight_one(loss):
    np.testing.assert_array_equal(RobustWeights(loss=loss).weights(np.zeros(5)), np.ones(5))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"loss": "l1"}, "loss must be one of none, huber"),
        ({"scale": 0.0}, "scale must be positive, got 0.0 m"),
        ({"min_scale": 0.0}, "min_scale must be positive"),
    ],
)
def test_settings_out_of_range_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        RobustWeights(**settings)
