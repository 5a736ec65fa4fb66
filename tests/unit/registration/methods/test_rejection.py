import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.registration.methods.rejection import (
    AdaptiveRejection,
    FixedRejection,
    TrimmedRejection,
    valley_after_peak,
)


def _spread(mean, deviation, count=1000):
    """Distances of exactly this mean and deviation."""
    raw = np.random.default_rng(0).normal(0.0, 1.0, count)
    return mean + deviation * (raw - raw.mean()) / raw.std()


@pytest.mark.parametrize(
    ("mean", "deviations"), [(0.5, 3.0), (1.0, 2.0), (2.9, 2.0), (3.0, 1.0), (5.9, 1.0)]
)
def test_the_limit_follows_the_cases_of_the_paper(mean, deviations):
    gate = AdaptiveRejection(good_distance=1.0)
    found = gate.threshold(_spread(mean, 0.1), np.inf, spacing=7.0)
    np.testing.assert_allclose(found, mean + deviations * 0.1, rtol=1e-12)


def test_really_bad_pairs_are_cut_at_the_valley_of_their_histogram():
    rng = np.random.default_rng(1)
    near, far = rng.normal(6.0, 0.5, 1500), rng.normal(12.0, 0.5, 1000)
    found = AdaptiveRejection(good_distance=1.0).threshold(np.concatenate([near, far]), np.inf, 1.0)
    # Between the humps, and neither the mean nor the median.
    assert 7.5 < found < 10.5
    np.testing.assert_allclose(found, valley_after_peak(np.concatenate([near, far])))


def test_the_valley_is_at_most_three_fifths_of_the_peak():
    # Tenths of a metre from 0 to 2: a dip to 70 % of the peak is no valley, one to 50 % is.
    counts = np.full(20, 20)
    counts[5], counts[8], counts[12] = 100, 70, 50
    counts[6:8], counts[9:12], counts[13:15] = 90, 80, 60
    middles = 0.05 + 0.1 * np.arange(20)
    distances = np.repeat(middles, counts)
    distances = np.append(distances, 2.0)
    found = valley_after_peak(distances)
    assert abs(found - middles[12]) < 0.11


def test_without_a_valley_half_of_the_pairs_are_believed():
    falling = np.sqrt(np.linspace(0.0, 100.0, 2000))  # ever denser up to the end
    np.testing.assert_allclose(valley_after_peak(falling), np.median(falling))
    assert valley_after_peak(np.full(30, 2.0)) == 2.0
    np.testing.assert_allclose(valley_after_peak(np.array([3.0])), 3.0)


def test_the_good_distance_comes_from_the_spacing_and_is_reported():
    gate = AdaptiveRejection()
    assert gate.good(0.2) == pytest.approx(0.6)
    assert gate.note(0.2) == "good pair distance D = 0.6 m, 3 times the spacing of the target"
    assert AdaptiveRejection(good_distance=0.6).note(0.2) == ""
    distances = _spread(0.5, 0.1)
    assert gate.threshold(distances, np.inf, 0.2) == AdaptiveRejection(good_distance=0.6).threshold(
        distances, np.inf, 1.0
    )


def test_statistics_of_zhang_forget_what_the_last_limit_dropped():
    distances = np.concatenate([_spread(0.5, 0.05), np.full(500, 30.0)])
    all_pairs = AdaptiveRejection(good_distance=1.0, statistics="all")
    kept = AdaptiveRejection(good_distance=1.0)
    assert all_pairs.threshold(distances, 2.0, 1.0) > 1.0
    np.testing.assert_allclose(kept.limit(distances, 2.0, 1.0), 0.5 + 3.0 * 0.05, rtol=1e-9)
    # Nothing was dropped yet in the first iteration.
    assert kept.limit(distances, np.inf, 1.0) == all_pairs.threshold(distances, np.inf, 1.0)


def test_a_limit_that_was_once_small_recovers_when_the_scans_part():
    gate = AdaptiveRejection(good_distance=0.5)
    limit = gate.threshold(_spread(0.02, 0.001), np.inf, 1.0)
    assert limit == 0.25  # the floor, half of D
    for _ in range(3):
        limit = gate.threshold(_spread(3.0, 0.5), limit, 1.0)
    assert limit > 2.5


@pytest.mark.parametrize("statistics", ["all", "kept"])
@pytest.mark.parametrize("count", [1, 30, 1000])
def test_a_least_share_of_the_pairs_is_always_kept(statistics, count):
    # Most pairs far beyond the mean of few: the plain limit would keep none.
    rng = np.random.default_rng(2)
    gate = AdaptiveRejection(good_distance=1e-3, min_threshold_ratio=0.0, statistics=statistics)
    for distances in (rng.uniform(1.0, 2.0, count), 5.0 + rng.exponential(1.0, count)):
        for previous in (np.inf, 1e-6):
            kept = np.sum(distances <= gate.threshold(distances, previous, 1.0))
            assert kept >= min(count, max(50, 0.1 * count))


def test_a_fixed_gate_never_moves():
    gate = FixedRejection(max_correspondence_distance=0.7)
    assert gate.threshold(np.array([5.0]), 0.1, 3.0) == gate.max_distance == 0.7
    assert gate.note(1.0) == ""


@pytest.mark.parametrize(("share", "kept"), [(1.0, 100), (0.7, 70), (0.001, 1)])
def test_a_trimmed_gate_keeps_its_share(share, kept):
    distances = np.random.default_rng(3).permutation(np.arange(100.0))
    gate = TrimmedRejection(inlier_ratio=share)
    assert np.sum(distances <= gate.threshold(distances, np.inf, 1.0)) == kept
    assert gate.note(1.0) == ""
    assert gate.max_distance == AdaptiveRejection().max_distance == np.inf


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: FixedRejection(max_correspondence_distance=0.0),
            "distance must be positive, got 0.0 m",
        ),
        (lambda: TrimmedRejection(inlier_ratio=1.2), "share must lie between 0 and 1"),
        (lambda: TrimmedRejection(inlier_ratio=0.0), "share must be positive"),
        (lambda: AdaptiveRejection(good_distance=-1.0), "good_distance must be positive"),
        (lambda: AdaptiveRejection(good_distance_in_spacings=0.0), "spacings must be positive"),
        (lambda: AdaptiveRejection(statistics="some"), "statistics must be 'all' or 'kept'"),
        (lambda: AdaptiveRejection(min_threshold_ratio=-1.0), "least_limit must be at least 0"),
        (lambda: AdaptiveRejection(min_kept_ratio=2.0), "least_share must lie between"),
        (lambda: AdaptiveRejection(min_kept=0), "least_pairs must be a whole number"),
    ],
)
def test_settings_out_of_range_are_refused(build, message):
    with pytest.raises(InvalidInput, match=message):
        build()
