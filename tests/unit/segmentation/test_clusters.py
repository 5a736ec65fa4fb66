import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from reference import flood
from reference.grouping import partition
from reference.samples import rotated_covariances, street
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput
from scanlock.models.gaussians import Gaussians
from scanlock.segmentation.clusters import ClusterFinder, GaussianFit, L2Distance, MeanDistance

_GRID = PolarGrid(sectors=40, max_range=20.0, first_width=1.5)

_TESTS = [
    (MeanDistance(max_distance=1.8), lambda a, b: flood.means_are_close(a, b, 1.8)),
    (
        L2Distance(min_correlation=0.02, min_deviation=0.4),
        lambda a, b: flood.densities_correlate(a, b, 0.02, 0.4),
    ),
    (
        GaussianFit(max_mahalanobis=3.5, min_deviation=0.3),
        lambda a, b: flood.one_gaussian_fits(a, b, 3.5, 0.3),
    ),
]


def _objects(seed, count=60, each=8):
    """Small objects around the sensor, some of them in several bins or beyond the range."""
    rng = np.random.default_rng(seed)
    azimuth = rng.uniform(-np.pi, np.pi, count)
    radius = rng.uniform(0.3, 22.0, count)
    centres = np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), 0 * radius])
    sizes = rng.uniform(0.1, 0.8, (count, 1, 1))
    return (centres[:, None] + sizes * rng.normal(size=(count, each, 3))).reshape(-1, 3)


def _one(mean, covariance, count=10):
    return Gaussians.from_covariances(
        np.array([mean], float), np.array([covariance], float), np.array([count])
    )


def _merges(test, first, second):
    gaussians = Gaussians.joined([first, second])
    bins = SimpleNamespace(means=gaussians.means, gaussians=gaussians)
    one, other = np.array([0]), np.array([1])
    merged = test.merges(bins, one, other)
    assert merged.tolist() == test.merges(bins, other, one).tolist()
    return bool(merged[0])


@pytest.mark.slow
@pytest.mark.parametrize(("test", "combine"), _TESTS, ids=lambda v: type(v).__name__)
@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_those_of_greedy_growth_from_any_bin(test, combine, seed):
    points = _objects(seed)
    labels, count = ClusterFinder(grid=_GRID, merge=test).grow(points)
    found = partition(labels)
    assert count == len(found)
    sizes = sorted(len(cluster) for cluster in found)
    assert sizes[-1] > 2 * sizes[0]
    for flood_seed in range(2):
        rng = np.random.default_rng(flood_seed)
        assert found == flood.flood(points, 40, _GRID.edges, combine, rng)


def test_azimuth_wraps():
    ring = np.array([[10.0, y, 0.0] for y in (-0.6, -0.5, 0.5, 0.6)])
    assert set(_GRID.cells(ring) // _GRID.bins) == {0, 39}
    labels, count = ClusterFinder(grid=_GRID).grow(ring)
    assert (count, set(labels)) == (1, {0})


def test_range_does_not_wrap():
    # The outermost bin of a sector and the innermost of the next have consecutive numbers.
    inner, outer = np.array([[0.7, 0.2, 0.0]]), np.array([[19.6, 0.2, 0.0]])
    grid = PolarGrid(sectors=3, max_range=20.0, first_width=1.5)
    everything = MeanDistance(max_distance=1e6)
    for angle in (-2.0, 0.0, 2.0):
        c, s = np.cos(angle), np.sin(angle)
        rotated = outer @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        points = np.vstack([inner, rotated])
        assert ClusterFinder(grid=grid, merge=everything).grow(points)[1] == 2


def test_only_the_eight_neighbours_combine():
    grid = PolarGrid(sectors=12, max_range=12.0, first_width=1.0)
    finder = ClusterFinder(grid=grid, merge=MeanDistance(max_distance=1e6))

    def centre(sector, ring):
        azimuth = (sector + 0.5) * np.pi / 6.0
        return [(ring + 0.5) * np.cos(azimuth), (ring + 0.5) * np.sin(azimuth), 0.0]

    for sector_step, ring_step in itertools.product(range(-2, 3), repeat=2):
        pair = np.array([centre(0, 5), centre(sector_step, 5 + ring_step)])
        touching = max(abs(sector_step), abs(ring_step)) <= 1
        assert (finder.grow(pair)[1] == 1) == touching


def test_means_combine_below_the_threshold_only():
    test = MeanDistance(max_distance=1.5)
    for distance, expected in ((1.4999, True), (1.5001, False)):
        direction = np.array([2.0, -1.0, 2.0]) / 3.0
        pair = (
            _one([5.0, 6.0, 7.0], np.eye(3)),
            _one([5.0, 6.0, 7.0] + distance * direction, np.eye(3)),
        )
        assert _merges(test, *pair) is expected


@pytest.mark.parametrize("seed", range(4))
def test_the_correlation_of_densities_matches_numerical_integration(seed):
    rng = np.random.default_rng(seed)
    covariances = rotated_covariances(rng, rng.uniform(0.3, 2.0, (2, 3)) ** 2)
    mean = rng.normal(size=3)
    # The trapezoid rule converges faster than any power for smooth functions.
    axis = np.arange(-11.0, 11.0, 0.35)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    f = multivariate_normal.pdf(grid, np.zeros(3), covariances[0])
    g = multivariate_normal.pdf(grid, mean, covariances[1])
    correlation = (f * g).sum() / np.sqrt((f * f).sum() * (g * g).sum())
    first, second = _one(np.zeros(3), covariances[0]), _one(mean, covariances[1])
    for factor, expected in ((0.999, True), (1.001, False)):
        test = L2Distance(min_correlation=factor * correlation, min_deviation=1e-3)
        assert _merges(test, first, second) is expected


def test_the_correlation_of_a_density_with_itself_is_one():
    same = _one([1.0, 2.0, 3.0], np.diag([0.5, 1.0, 2.0]))
    assert _merges(L2Distance(min_correlation=1.0 - 1e-9), same, same)


def test_flat_bins_are_regularised_before_they_are_compared():
    flat = np.diag([1.0, 1.0, 0.0])
    lower, upper = _one([0.0, 0.0, 0.0], flat), _one([0.0, 0.0, 0.2], flat)
    # Both deviations are raised to 0.2 m: the correlation is exp(-0.2^2 / (4 0.2^2)).
    correlation = np.exp(-0.25)
    for factor, expected in ((0.999, True), (1.001, False)):
        assert _merges(L2Distance(min_correlation=factor * correlation), lower, upper) is expected
    # The pooled deviation is raised to 0.2 m too: the Mahalanobis distance of the means is 1.
    for distance, expected in ((0.999, False), (1.001, True)):
        assert _merges(GaussianFit(max_mahalanobis=distance), lower, upper) is expected


def _halves(quantile):
    """Sample of a distribution along an oblique line, split at its median."""
    positions = quantile((np.arange(20_000) + 0.5) / 20_000)
    points = positions[:, None] * np.array([0.6, 0.0, 0.8]) * 5.0
    labels = (np.arange(20_000) >= 10_000).astype(np.int64)
    both = Gaussians.from_labels(points, labels)
    return both.taken(np.array([0])), both.taken(np.array([1]))


@pytest.mark.parametrize(
    ("quantile", "deviations"),
    [
        # Half of a normal distribution has the mean sqrt(2 / pi) and the variance 1 - 2 / pi.
        (norm.ppf, 2.0 * np.sqrt(2.0 / np.pi) / np.sqrt(1.0 - 2.0 / np.pi)),
        # The halves of a strip of length 1 have means 1/2 apart and the variance 1 / 48.
        (lambda q: q, np.sqrt(12.0)),
    ],
    ids=["normal", "strip"],
)
def test_the_distances_between_halves_match_the_docstring(quantile, deviations):
    # A minimum of 1 mm changes a deviation of metres by less than 1e-6; the moments of the sample
    # differ from the exact ones by less than 1e-3.
    halves = _halves(quantile)
    for factor, expected in ((0.998, False), (1.002, True)):
        test = GaussianFit(max_mahalanobis=factor * deviations, min_deviation=1e-3)
        assert _merges(test, *halves) is expected
    assert round(float(deviations), 1) in (2.6, 2.7, 3.5)


def test_two_separate_objects_do_not_fit_one_gaussian():
    rng = np.random.default_rng(5)
    for distance, expected in ((1.0, True), (8.0, False)):
        points = rng.normal(size=(400, 3)) + distance * (np.arange(400) >= 200)[:, None] * [
            1.0,
            0,
            0,
        ]
        both = Gaussians.from_labels(points, (np.arange(400) >= 200).astype(np.int64))
        halves = both.taken(np.array([0])), both.taken(np.array([1]))
        assert _merges(GaussianFit(), *halves) is expected


def test_no_split_cluster_exceeds_the_largest_radius():
    finder = ClusterFinder(merge=MeanDistance(max_distance=3.0))
    points = _obstacles()
    labels, count = finder.grow(points)
    radii = [_radius(points[labels == k]) for k in range(count)]
    for max_radius in (2.0, 1.0, 0.3):
        split, split_count = finder.split(points, labels, count, max_radius)
        assert max(radii) > max_radius
        assert max(_radius(points[split == k]) for k in range(split_count)) <= max_radius
        assert _is_refined(split, labels)
        np.testing.assert_array_equal(np.unique(split[split >= 0]), np.arange(split_count))
        np.testing.assert_array_equal(split < 0, labels < 0)


def test_splits_are_nested():
    finder, points = ClusterFinder(), _obstacles()
    labels, count = finder.grow(points)
    direct, _ = finder.split(points, labels, count, 0.7)
    for radius in (5.0, 2.5, 1.4, 0.7):
        labels, count = finder.split(points, labels, count, radius)
    assert partition(labels) == partition(direct)


def test_clusters_do_not_depend_on_the_order_of_points():
    finder, points = ClusterFinder(), _obstacles()
    labels, count = finder.label(points)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(points))
        shuffled, shuffled_count = finder.label(points[order])
        restored = np.empty_like(shuffled)
        restored[order] = shuffled
        assert shuffled_count == count
        assert partition(restored) == partition(labels)


def test_a_split_through_a_point_does_not_depend_on_the_order_of_points():
    # One of evenly spaced points may be on the plane through their mean, where rounding decides.
    finder = ClusterFinder()
    rng = np.random.default_rng(0)
    for _ in range(40):
        lattice = np.zeros((int(rng.integers(3, 9)), 3))
        lattice[:, 0] = 0.1 * np.arange(len(lattice)) + rng.uniform(0.0, 50.0)
        order = rng.permutation(len(lattice))
        together = np.zeros(len(lattice), np.int64)
        expected, _ = finder.split(lattice, together, 1, 0.11)
        shuffled, _ = finder.split(lattice[order], together, 1, 0.11)
        restored = np.empty_like(shuffled)
        restored[order] = shuffled
        assert partition(restored) == partition(expected)


def test_small_clusters_are_dropped_and_the_others_renumbered():
    points = np.concatenate(
        [np.full((n, 3), [r, 0.1, 0.0]) for n, r in ((5, 4.0), (6, 9.0), (1, 14.0), (7, 18.0))]
    )
    labels, count = ClusterFinder(min_points=6).label(points)
    assert count == 2
    np.testing.assert_array_equal(labels, np.repeat([-1, 0, -1, 1], [5, 6, 1, 7]))


def test_points_beyond_the_grid_belong_to_no_cluster():
    points = np.tile([[25.0, 0.0, 0.0], [5.0, 0.0, 0.0]], (8, 1))
    labels, count = ClusterFinder(grid=_GRID).label(points)
    assert count == 1
    np.testing.assert_array_equal(labels, [-1, 0] * 8)


@pytest.mark.parametrize("points", [np.empty((0, 3)), np.full((3, 3), 500.0)])
def test_no_points_within_the_grid_give_no_clusters(points):
    for labels, count in (ClusterFinder().grow(points), ClusterFinder().label(points)):
        assert count == 0
        np.testing.assert_array_equal(labels, np.full(len(points), -1))


def test_identical_points_are_one_cluster():
    labels, count = ClusterFinder().label(np.full((100, 3), 3.3))
    assert (count, set(labels)) == (1, {0})


def _obstacles():
    points = street(0, 4000)
    return points[points[:, 2] > -1.5]


def _radius(points):
    return np.linalg.norm(points - points.mean(axis=0), axis=1).max()


def _is_refined(fine, coarse):
    return all(len(set(coarse[fine == k])) == 1 for k in set(fine[fine >= 0]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MeanDistance(max_distance=0.0), "max_distance must be positive, got 0.0 m"),
        (lambda: L2Distance(min_correlation=1.5), "min_correlation must lie between 0 and 1"),
        (lambda: L2Distance(min_deviation=0.0), "min_deviation must be positive, got 0.0 m"),
        (lambda: GaussianFit(max_mahalanobis=-1.0), "max_mahalanobis must be positive, got -1.0"),
        (lambda: GaussianFit(min_deviation=0.0), "min_deviation must be positive, got 0.0 m"),
        (lambda: ClusterFinder(max_radius=0.0), "max_radius must be positive, got 0.0 m"),
        (lambda: ClusterFinder(min_points=0), "min_points must be"),
    ],
)
def test_invalid_settings_are_rejected_by_name(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()


def test_gaussians_are_those_of_the_clusters_split_to_each_radius():
    finder, points = ClusterFinder(min_points=4), _obstacles()
    labels, count = finder.grow(points)
    radii = [5.0, 1.4, 0.7]
    for radius, found in zip(radii, finder.gaussians(points, labels, count, radii), strict=True):
        split, _ = finder.split(points, labels, count, radius)
        expected = Gaussians.from_labels(points, split, 4)
        assert len(found) == len(expected) > 5
        order, expected_order = (np.lexsort(one.means.T) for one in (found, expected))
        np.testing.assert_array_equal(found.counts[order], expected.counts[expected_order])
        np.testing.assert_allclose(found.means[order], expected.means[expected_order], atol=1e-12)
        np.testing.assert_allclose(
            found.covariances[order], expected.covariances[expected_order], atol=1e-12
        )
