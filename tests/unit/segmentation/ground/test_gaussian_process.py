import numpy as np
import pytest

from reference import gaussian_process as slow
from scanlock.errors import InvalidInput
from scanlock.kernels.ground.gaussian_process import decay, grow_sectors
from scanlock.segmentation.ground.gaussian_process import GaussianProcess, Lending

_GATES = {"variance_limit": 0.04, "residual_limit": 3.0}


def _sectors(rng, count=12, most=25):
    """Ranges and heights of the prototypes of some sectors: gentle ground, steps, stray points."""
    ranges = [np.sort(rng.uniform(2, 60, rng.integers(0, most))) for _ in range(count)]
    heights = [
        0.3 * np.sin(r / 8 + 0.2 * s) + rng.normal(0, 0.05, len(r)) for s, r in enumerate(ranges)
    ]
    for z in heights:
        z[rng.random(len(z)) < 0.2] += 1.0
    return ranges, heights


def _starts(ranges):
    return np.concatenate([[0], np.cumsum([len(r) for r in ranges])]).astype(np.int64)


def _one_sector(process, r, z, seeds, **gates):
    starts = np.array([0, len(r)] + [len(r)] * 2)
    return process.consensus(starts, r, z, seeds, **(_GATES | gates))


def test_decay_is_the_exponential():
    x = np.concatenate([[0.0], np.geomspace(1e-9, 59.0, 400)])
    assert np.allclose([decay(v) for v in x], np.exp(-x), rtol=1e-9, atol=1e-13)
    assert 0.0 <= decay(1e9) < 1e-25


def test_mean_and_variance_follow_the_textbook():
    rng = np.random.default_rng(0)
    process = GaussianProcess(length_scale=7.0, signal_deviation=0.8, noise_deviation=0.1)
    r = np.sort(rng.uniform(2, 50, 30))
    z = rng.normal(0, 0.5, 30)
    seeds = rng.random(30) < 0.4
    # No candidate can join, so that exactly the seeds are the observations.
    accepted, mean, variance = _one_sector(process, r, z, seeds, variance_limit=1e-12)
    expected = slow.regression(r[seeds], z[seeds], np.full(seeds.sum(), 0.01), r, 7.0, 0.64)
    assert (accepted == seeds).all()
    assert np.allclose(mean, expected[0], atol=1e-9)
    assert np.allclose(variance, expected[1], atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_consensus_with_lending_equals_its_definition(seed):
    rng = np.random.default_rng(seed)
    ranges, heights = _sectors(rng)
    heights[3][:2] = np.nan
    seeds = [(np.abs(z) < 0.3) & (r < 25) & (rng.random(len(r)) < 0.7)
             for r, z in zip(ranges, heights, strict=True)]  # fmt: skip
    caps = [np.where(rng.random(len(r)) < 0.5, 0.1, np.inf) for r in ranges]
    rounds, reach, slope, gap = 2, 3, 0.05, 1.5
    length, signal, noise = 9.0, 0.25, 0.0036
    offers = [[None] * len(r) for r in ranges]
    means, variances = [], []
    for turn in range(rounds + 1):
        if turn:
            new = slow.lent_heights(ranges, heights, means, variances, 0.04, reach, slope, gap)
            for old, fresh in zip(offers, new, strict=True):
                old[:] = [b if b is not None else a for a, b in zip(old, fresh, strict=True)]
        results = [
            slow.sector_consensus(r, z, s, c, o, length, signal, noise, 0.04, 3.0)
            for r, z, s, c, o in zip(ranges, heights, seeds, caps, offers, strict=True)
        ]
        means = [m for _, m, _ in results]
        variances = [v for _, _, v in results]
    process = GaussianProcess(length_scale=9.0, signal_deviation=0.5, noise_deviation=0.06)
    lending = Lending(rounds=rounds, reach=reach, gap=gap, slope_deviation=slope)
    accepted, mean, variance = process.consensus(
        _starts(ranges), np.concatenate(ranges), np.concatenate(heights), np.concatenate(seeds),
        caps=np.concatenate(caps), lending=lending, **_GATES,
    )  # fmt: skip
    assert (accepted == np.concatenate([a for a, _, _ in results])).all()
    assert np.allclose(mean, np.concatenate(means), atol=1e-8)
    assert np.allclose(variance, np.concatenate(variances), atol=1e-8)
    assert any(offer is not None for sector in offers for offer in sector)


def test_published_settings_drift_to_the_height_of_the_sensor():
    # Seeds at 4 to 20 m on ground 1.73 m below a zero mean: the figures of the public code.
    process = GaussianProcess(length_scale=10.0, signal_deviation=1.0, noise_deviation=np.sqrt(0.3))
    r = np.concatenate([np.arange(4.0, 21.0), [25.0, 30.0, 40.0]])
    z = np.where(r <= 20, -1.73, np.nan)
    _, mean, variance = _one_sector(process, r, z, r <= 20, variance_limit=5.0, residual_limit=5.0)
    assert np.allclose(mean[-3:], [-1.21, -0.78, -0.16], atol=0.02)
    # The variance never reaches its published limit, so that gate is always open.
    assert variance.max() <= 1.0 < 5.0
    # About a mean function at the ground there is nothing to drift to.
    _, mean, _ = _one_sector(process, r, z + 1.73, r <= 20, variance_limit=5.0)
    assert np.abs(mean).max() < 1e-12


@pytest.mark.parametrize(
    ("process", "height", "joins"),
    [
        # In reach of the seeds, a lowest point 0.5 m above ground joins the published model ...
        (GaussianProcess(signal_deviation=1.0, noise_deviation=np.sqrt(0.3)), 0.5, True),
        # ... and not the corrected one.
        (GaussianProcess(), 0.5, False),
        (GaussianProcess(), 0.05, True),
    ],
)
def test_what_a_gate_lets_in(process, height, joins):
    r = np.arange(4.0, 16.0)
    z = np.zeros(12)
    z[-1] = height
    seeds = np.arange(12) < 11
    accepted, _, _ = _one_sector(
        process, r, z, seeds, **({"variance_limit": 5.0, "residual_limit": 5.0} if
                                 process.signal_deviation == 1.0 else {}),
    )  # fmt: skip
    assert accepted[-1] == joins


def test_a_sector_without_seeds_stays_at_the_prior():
    r = np.array([3.0, 5.0, 9.0])
    accepted, mean, variance = _one_sector(
        GaussianProcess(), r, np.zeros(3), np.zeros(3, bool), variance_limit=5.0
    )
    assert not accepted.any()
    assert (mean == 0).all()
    assert np.allclose(variance, 0.25)


def test_no_prototypes_at_all():
    empty = np.zeros(0)
    starts = np.zeros(5, dtype=np.int64)
    accepted, mean, variance = GaussianProcess().consensus(
        starts, empty, empty, np.zeros(0, bool), lending=Lending(), **_GATES
    )
    assert len(accepted) == len(mean) == len(variance) == 0


def test_one_compiled_form_serves_all():
    assert len(getattr(grow_sectors, "signatures", ())) <= 1


@pytest.mark.parametrize("name", ["length_scale", "signal_deviation", "noise_deviation"])
def test_scales_must_be_positive(name):
    with pytest.raises(InvalidInput, match=name):
        GaussianProcess(**{name: 0.0})


@pytest.mark.parametrize(
    ("name", "value"), [("rounds", -1), ("reach", 0), ("gap", 0.0), ("slope_deviation", -0.1)]
)
def test_lending_is_checked(name, value):
    with pytest.raises(InvalidInput, match=name):
        Lending(**{name: value})
