import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.registration.methods.icp.distance_rejection import (
    AdaptiveRejection,
    FixedRejection,
    TrimmedRejection,
    valley_after_peak,
)


def _distances(mean, deviation, count=1000):
    """Distances of exactly this mean and standard deviation."""
    raw = np.random.default_rng(0).normal(0.0, 1.0, count)
    return mean + deviation * (raw - raw.mean()) / raw.std()


@pytest.mark.parametrize(
    ("mean", "deviations"), [(0.5, 3.0), (1.0, 2.0), (2.9, 2.0), (3.0, 1.0), (5.9, 1.0)]
)
def test_the_adaptive_threshold_follows_the_cases_of_the_paper(mean, deviations):
    rejection = AdaptiveRejection(good_distance=1.0)
    found = rejection.threshold(_distances(mean, 0.1), np.inf, spacing=7.0)
    np.testing.assert_allclose(found, mean + deviations * 0.1, rtol=1e-12)


def test_beyond_the_cases_the_threshold_is_the_valley_of_the_histogram():
    rng = np.random.default_rng(1)
    near, far = rng.normal(6.0, 0.5, 1500), rng.normal(12.0, 0.5, 1000)
    distances = np.concatenate([near, far])
    found = AdaptiveRejection(good_distance=1.0).threshold(distances, np.inf, 1.0)
    # Between the two modes, and neither the mean nor the median.
    assert 7.5 < found < 10.5
    np.testing.assert_allclose(found, valley_after_peak(distances))


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


def test_without_a_valley_the_median_is_returned():
    rising = np.sqrt(np.linspace(0.0, 100.0, 2000))  # density increases up to the largest distance
    np.testing.assert_allclose(valley_after_peak(rising), np.median(rising))
    assert valley_after_peak(np.full(30, 2.0)) == 2.0
    np.testing.assert_allclose(valley_after_peak(np.array([3.0])), 3.0)


def test_the_good_distance_comes_from_the_spacing_and_is_reported():
    rejection = AdaptiveRejection()
    assert rejection.good_distance_at(0.2) == pytest.approx(0.6)
    assert str(rejection.note(0.2)) == (
        "good correspondence distance D = 0.6 m, 3 times the spacing of the target"
    )
    given = AdaptiveRejection(good_distance=0.6)
    assert given.note(0.2) == ""
    distances = _distances(0.5, 0.1)
    found = rejection.threshold(distances, np.inf, 0.2)
    assert found == given.threshold(distances, np.inf, 1.0)


def test_statistics_of_kept_correspondences_ignore_rejected_ones():
    distances = np.concatenate([_distances(0.5, 0.05), np.full(500, 30.0)])
    of_all = AdaptiveRejection(good_distance=1.0, statistics="all")
    of_kept = AdaptiveRejection(good_distance=1.0)
    assert of_all.threshold(distances, 2.0, 1.0) > 1.0
    found = of_kept.threshold(distances, 2.0, 1.0)
    np.testing.assert_allclose(found, 0.5 + 3.0 * 0.05, rtol=1e-9)
    # The first iteration has no previous threshold.
    found = of_kept.threshold(distances, np.inf, 1.0)
    assert found == of_all.threshold(distances, np.inf, 1.0)


def test_a_small_threshold_recovers_when_distances_grow():
    rejection = AdaptiveRejection(good_distance=0.5)
    threshold = rejection.threshold(_distances(0.02, 0.001), np.inf, 1.0)
    assert threshold == 0.25  # half of D, the minimum
    for _ in range(3):
        threshold = rejection.threshold(_distances(3.0, 0.5), threshold, 1.0)
    assert threshold > 2.5


@pytest.mark.parametrize("statistics", ["all", "kept"])
@pytest.mark.parametrize("count", [1, 30, 1000])
def test_a_minimum_of_the_correspondences_is_kept(statistics, count):
    # Most distances far exceed the mean of a few: the statistics alone would keep none.
    rng = np.random.default_rng(2)
    rejection = AdaptiveRejection(
        good_distance=1e-3, min_threshold_ratio=0.0, statistics=statistics
    )
    for distances in (rng.uniform(1.0, 2.0, count), 5.0 + rng.exponential(1.0, count)):
        for previous in (np.inf, 1e-6):
            kept = np.sum(distances <= rejection.threshold(distances, previous, 1.0))
            assert kept >= min(count, max(50, 0.1 * count))


def test_a_fixed_threshold_is_constant():
    rejection = FixedRejection(max_correspondence_distance=0.7)
    assert rejection.threshold(np.array([5.0]), 0.1, 3.0) == rejection.max_distance == 0.7
    assert rejection.note(1.0) == ""


@pytest.mark.parametrize(("ratio", "kept"), [(1.0, 100), (0.7, 70), (0.001, 1)])
def test_a_trimmed_rejection_keeps_its_inlier_ratio(ratio, kept):
    distances = np.random.default_rng(3).permutation(np.arange(100.0))
    rejection = TrimmedRejection(inlier_ratio=ratio)
    assert np.sum(distances <= rejection.threshold(distances, np.inf, 1.0)) == kept
    assert rejection.note(1.0) == ""
    assert rejection.max_distance == AdaptiveRejection().max_distance == np.inf


@pytest.mark.parametrize(
    ("kind", "settings", "message"),
    [
        (
            FixedRejection,
            {"max_correspondence_distance": 0.0},
            "max_correspondence_distance must be positive, got 0.0 m",
        ),
        (TrimmedRejection, {"inlier_ratio": 1.2}, "inlier_ratio must lie between 0 and 1"),
        (TrimmedRejection, {"inlier_ratio": 0.0}, "inlier_ratio must be positive"),
        (AdaptiveRejection, {"good_distance": -1.0}, "good_distance must be positive"),
        (
            AdaptiveRejection,
            {"good_distance_in_spacings": 0.0},
            "good_distance_in_spacings must be positive",
        ),
        (AdaptiveRejection, {"statistics": "some"}, "statistics must be 'all' or 'kept'"),
        (
            AdaptiveRejection,
            {"min_threshold_ratio": -1.0},
            "min_threshold_ratio must be at least 0",
        ),
        (AdaptiveRejection, {"min_kept_ratio": 2.0}, "min_kept_ratio must lie between"),
        (AdaptiveRejection, {"min_kept": 0}, "min_kept must be a whole number"),
    ],
)
def test_invalid_settings_raise(kind, settings, message):
    with pytest.raises(InvalidInput, match=message):
        kind(**settings)
