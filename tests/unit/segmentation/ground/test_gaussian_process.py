import numpy as np
import pytest

from reference import gaussian_process as slow
from scanlock.errors import InvalidInput
from scanlock.kernels.ground.gaussian_process import grow_sectors
from scanlock.segmentation.ground.gaussian_process import (
    GaussianProcess,
    Insac,
    SectorInterpolation,
)


def _sectors(rng, count=12, max_count=25):
    """Ranges and heights of the prototypes of sectors: gentle ground, steps and outliers."""
    ranges = [np.sort(rng.uniform(2, 60, rng.integers(0, max_count))) for _ in range(count)]
    heights = [
        0.3 * np.sin(r / 8 + 0.2 * s) + rng.normal(0, 0.05, len(r)) for s, r in enumerate(ranges)
    ]
    for z in heights:
        z[rng.random(len(z)) < 0.2] += 1.0
    return ranges, heights


def _starts(ranges):
    return np.concatenate([[0], np.cumsum([len(r) for r in ranges])]).astype(np.int64)


def _one_sector(process, r, z, seeds, **thresholds):
    starts = np.array([0, len(r)] + [len(r)] * 2)
    alone = SectorInterpolation(iterations=0)
    insac = Insac(process=process, interpolation=alone, **thresholds)
    return insac.grow(starts, r, z, seeds)


def test_mean_and_variance_are_those_of_gaussian_process_regression():
    rng = np.random.default_rng(0)
    process = GaussianProcess(length_scale=7.0, signal_deviation=0.8, noise_deviation=0.1)
    r = np.sort(rng.uniform(2, 50, 30))
    z = rng.normal(0, 0.5, 30)
    seeds = rng.random(30) < 0.4
    # No candidate can join, so the observations are the seeds.
    accepted, mean, variance = _one_sector(process, r, z, seeds, variance_threshold=1e-12)
    expected = slow.regression(r[seeds], z[seeds], np.full(seeds.sum(), 0.01), r, 7.0, 0.64)
    assert (accepted == seeds).all()
    assert np.allclose(mean, expected[0], atol=1e-9)
    assert np.allclose(variance, expected[1], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_growth_with_interpolation_matches_its_definition(seed):
    rng = np.random.default_rng(seed)
    ranges, heights = _sectors(rng)
    heights[3][:2] = np.nan
    seeds = [(np.abs(z) < 0.3) & (r < 25) & (rng.random(len(r)) < 0.7)
             for r, z in zip(ranges, heights, strict=True)]  # fmt: skip
    max_residuals = [np.where(rng.random(len(r)) < 0.5, 0.1, np.inf) for r in ranges]
    iterations, max_sectors, slope, max_difference = 2, 3, 0.05, 1.5
    length, signal, noise = 9.0, 0.25, 0.0036
    borrowed = [[None] * len(r) for r in ranges]
    means, variances = [], []
    for iteration in range(iterations + 1):
        if iteration:
            updated = slow.interpolated_heights(
                ranges, heights, means, variances, 0.04, max_sectors, slope, max_difference
            )
            for old, new in zip(borrowed, updated, strict=True):
                old[:] = [b if b is not None else a for a, b in zip(old, new, strict=True)]
        results = [
            slow.sector_consensus(r, z, s, c, o, length, signal, noise, 0.04, 3.0)
            for r, z, s, c, o in zip(ranges, heights, seeds, max_residuals, borrowed, strict=True)
        ]
        means = [m for _, m, _ in results]
        variances = [v for _, _, v in results]
    insac = Insac(
        process=GaussianProcess(length_scale=9.0, signal_deviation=0.5, noise_deviation=0.06),
        variance_threshold=0.04,
        residual_threshold=3.0,
        interpolation=SectorInterpolation(
            iterations=iterations,
            max_sectors=max_sectors,
            max_range_difference=max_difference,
            slope_deviation=slope,
        ),
    )
    accepted, mean, variance = insac.grow(
        _starts(ranges), np.concatenate(ranges), np.concatenate(heights), np.concatenate(seeds),
        np.concatenate(max_residuals),
    )  # fmt: skip
    assert (accepted == np.concatenate([a for a, _, _ in results])).all()
    assert np.allclose(mean, np.concatenate(means), atol=1e-8)
    assert np.allclose(variance, np.concatenate(variances), atol=1e-8)
    assert any(height is not None for sector in borrowed for height in sector)


def test_published_settings_return_to_the_height_of_the_sensor():
    # Seeds at 4 to 20 m on ground 1.73 m below a zero mean: the figures of the public code.
    process = GaussianProcess(length_scale=10.0, signal_deviation=1.0, noise_deviation=np.sqrt(0.3))
    r = np.concatenate([np.arange(4.0, 21.0), [25.0, 30.0, 40.0]])
    z = np.where(r <= 20, -1.73, np.nan)
    _, mean, variance = _one_sector(
        process, r, z, r <= 20, variance_threshold=5.0, residual_threshold=5.0
    )
    assert np.allclose(mean[-3:], [-1.21, -0.78, -0.16], atol=0.02)
    # The variance never exceeds its published threshold.
    assert variance.max() <= 1.0 < 5.0
    # About a mean function at the ground the model remains there.
    _, mean, _ = _one_sector(process, r, z + 1.73, r <= 20, variance_threshold=5.0)
    assert np.abs(mean).max() < 1e-12


@pytest.mark.parametrize(
    ("process", "height", "joins"),
    [
        # Near the seeds, a lowest point 0.5 m above the ground joins the published model ...
        (GaussianProcess(signal_deviation=1.0, noise_deviation=np.sqrt(0.3)), 0.5, True),
        # ... but not the corrected one.
        (GaussianProcess(), 0.5, False),
        (GaussianProcess(), 0.05, True),
    ],
)
def test_a_prototype_joins_within_the_residual_threshold(process, height, joins):
    r = np.arange(4.0, 16.0)
    z = np.zeros(12)
    z[-1] = height
    seeds = np.arange(12) < 11
    accepted, _, _ = _one_sector(
        process, r, z, seeds, **({"variance_threshold": 5.0, "residual_threshold": 5.0} if
                                 process.signal_deviation == 1.0 else {}),
    )  # fmt: skip
    assert accepted[-1] == joins


def test_a_sector_without_seeds_has_the_prior():
    r = np.array([3.0, 5.0, 9.0])
    accepted, mean, variance = _one_sector(
        GaussianProcess(), r, np.zeros(3), np.zeros(3, bool), variance_threshold=5.0
    )
    assert not accepted.any()
    assert (mean == 0).all()
    assert np.allclose(variance, 0.25)


def test_no_prototypes_give_an_empty_model():
    empty = np.zeros(0)
    starts = np.zeros(5, dtype=np.int64)
    accepted, mean, variance = Insac().grow(starts, empty, empty, np.zeros(0, bool))
    assert len(accepted) == len(mean) == len(variance) == 0


def test_the_kernel_has_one_compiled_signature():
    assert len(getattr(grow_sectors, "signatures", ())) <= 1


@pytest.mark.parametrize("name", ["length_scale", "signal_deviation", "noise_deviation"])
def test_settings_of_the_process_must_be_positive(name):
    with pytest.raises(InvalidInput, match=name):
        GaussianProcess(**{name: 0.0})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("iterations", -1),
        ("max_sectors", 0),
        ("max_range_difference", 0.0),
        ("slope_deviation", -0.1),
    ],
)
def test_invalid_settings_of_the_interpolation_are_rejected(name, value):
    with pytest.raises(InvalidInput, match=name):
        SectorInterpolation(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"), [("variance_threshold", 0.0), ("residual_threshold", -1.0)]
)
def test_thresholds_must_be_positive(name, value):
    with pytest.raises(InvalidInput, match=name):
        Insac(**{name: value})
