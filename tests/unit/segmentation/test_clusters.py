import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import multivariate_normal, norm

from reference import flood
from reference.grouping import partition
from reference.samples import street, turned_covariances
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.errors import InvalidInput
from scanlock.models.gaussians import Gaussians
from scanlock.segmentation.clusters import ClusterFinder, GaussianFit, L2Distance, MeanDistance

_GRID = PolarGrid(sectors=40, max_range=20.0, first_width=1.5)

_TESTS = [
    (MeanDistance(limit=1.8), lambda a, b: flood.means_are_close(a, b, 1.8)),
    (
        L2Distance(least_correlation=0.02, min_deviation=0.4),
        lambda a, b: flood.densities_correlate(a, b, 0.02, 0.4),
    ),
    (
        GaussianFit(limit=3.5, min_deviation=0.3),
        lambda a, b: flood.one_gaussian_fits(a, b, 3.5, 0.3),
    ),
]


def _heaps(seed, count=60, each=8):
    """Small heaps all round the sensor, some of them a few bins long, some beyond the range."""
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


@pytest.mark.parametrize(("test", "combine"), _TESTS, ids=lambda v: type(v).__name__)
@pytest.mark.parametrize("seed", range(3))
def test_clusters_are_those_of_the_greedy_flood_from_any_bin(test, combine, seed):
    points = _heaps(seed)
    labels, count = ClusterFinder(grid=_GRID, merge=test).grow(points)
    found = partition(labels)
    assert count == len(found)
    sizes = sorted(len(cluster) for cluster in found)
    assert sizes[-1] > 2 * sizes[0]
    for flood_seed in range(2):
        rng = np.random.default_rng(flood_seed)
        assert found == flood.flood(points, 40, _GRID.edges, combine, rng)


def test_a_cluster_across_the_seam_of_azimuth_is_one():
    ring = np.array([[10.0, y, 0.0] for y in (-0.6, -0.5, 0.5, 0.6)])
    assert set(_GRID.cells(ring) // _GRID.bins) == {0, 39}
    labels, count = ClusterFinder(grid=_GRID).grow(ring)
    assert (count, set(labels)) == (1, {0})


def test_range_does_not_wrap():
    # The outermost bin of one sector and the innermost of the next are numbered side by side.
    inner, outer = np.array([[0.7, 0.2, 0.0]]), np.array([[19.6, 0.2, 0.0]])
    grid = PolarGrid(sectors=3, max_range=20.0, first_width=1.5)
    everything = MeanDistance(limit=1e6)
    for turn in (-2.0, 0.0, 2.0):
        c, s = np.cos(turn), np.sin(turn)
        turned = outer @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        points = np.vstack([inner, turned])
        assert ClusterFinder(grid=grid, merge=everything).grow(points)[1] == 2


def test_all_eight_neighbours_are_tried_and_no_other():
    grid = PolarGrid(sectors=12, max_range=12.0, first_width=1.0)
    finder = ClusterFinder(grid=grid, merge=MeanDistance(limit=1e6))

    def middle(sector, ring):
        azimuth = (sector + 0.5) * np.pi / 6.0
        return [(ring + 0.5) * np.cos(azimuth), (ring + 0.5) * np.sin(azimuth), 0.0]

    for sector_step, ring_step in itertools.product(range(-2, 3), repeat=2):
        pair = np.array([middle(0, 5), middle(sector_step, 5 + ring_step)])
        touching = max(abs(sector_step), abs(ring_step)) <= 1
        assert (finder.grow(pair)[1] == 1) == touching


def test_means_combine_below_the_limit_only():
    test = MeanDistance(limit=1.5)
    for gap, expected in ((1.4999, True), (1.5001, False)):
        direction = np.array([2.0, -1.0, 2.0]) / 3.0
        pair = _one([5.0, 6.0, 7.0], np.eye(3)), _one([5.0, 6.0, 7.0] + gap * direction, np.eye(3))
        assert _merges(test, *pair) is expected


@pytest.mark.parametrize("seed", range(4))
def test_the_correlation_of_densities_is_what_integration_gives(seed):
    rng = np.random.default_rng(seed)
    covariances = turned_covariances(rng, rng.uniform(0.3, 2.0, (2, 3)) ** 2)
    mean = rng.normal(size=3)
    # The trapezoid rule converges faster than any power for functions as smooth as these.
    axis = np.arange(-11.0, 11.0, 0.35)
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1)
    f = multivariate_normal.pdf(grid, np.zeros(3), covariances[0])
    g = multivariate_normal.pdf(grid, mean, covariances[1])
    correlation = (f * g).sum() / np.sqrt((f * f).sum() * (g * g).sum())
    first, second = _one(np.zeros(3), covariances[0]), _one(mean, covariances[1])
    for share, expected in ((0.999, True), (1.001, False)):
        test = L2Distance(least_correlation=share * correlation, min_deviation=1e-3)
        assert _merges(test, first, second) is expected


def test_the_correlation_of_a_density_with_itself_is_one():
    same = _one([1.0, 2.0, 3.0], np.diag([0.5, 1.0, 2.0]))
    assert _merges(L2Distance(least_correlation=1.0 - 1e-9), same, same)


def test_flat_bins_are_floored_before_they_are_compared():
    flat = np.diag([1.0, 1.0, 0.0])
    lower, upper = _one([0.0, 0.0, 0.0], flat), _one([0.0, 0.0, 0.2], flat)
    # Both deviations are floored to 0.2 m: the correlation is exp(-0.2^2 / (4 0.2^2)).
    limit = np.exp(-0.25)
    for share, expected in ((0.999, True), (1.001, False)):
        assert _merges(L2Distance(least_correlation=share * limit), lower, upper) is expected
    # The pooled scatter is floored to 0.2 m too: the means are one deviation apart.
    for share, expected in ((0.999, False), (1.001, True)):
        assert _merges(GaussianFit(limit=share), lower, upper) is expected


def _halves(quantile):
    """A sample of a distribution along a slanted line, cut at its middle."""
    places = quantile((np.arange(20_000) + 0.5) / 20_000)
    points = places[:, None] * np.array([0.6, 0.0, 0.8]) * 5.0
    labels = (np.arange(20_000) >= 10_000).astype(np.int64)
    both = Gaussians.from_labels(points, labels)
    return both.taken(np.array([0])), both.taken(np.array([1]))


@pytest.mark.parametrize(
    ("quantile", "deviations"),
    [
        # Half a normal has mean sqrt(2 / pi) and variance 1 - 2 / pi.
        (norm.ppf, 2.0 * np.sqrt(2.0 / np.pi) / np.sqrt(1.0 - 2.0 / np.pi)),
        # Half a strip of length 1 has its mean 1/2 from the other's and variance 1 / 48.
        (lambda q: q, np.sqrt(12.0)),
    ],
    ids=["normal", "strip"],
)
def test_a_cut_in_half_measures_what_the_docstring_says(quantile, deviations):
    # The floor of 1 mm adds less than a millionth to a scatter of metres along the line; the
    # sample's own half moments are off by its last quantiles, under 1e-3.
    halves = _halves(quantile)
    for share, expected in ((0.998, False), (1.002, True)):
        test = GaussianFit(limit=share * deviations, min_deviation=1e-3)
        assert _merges(test, *halves) is expected
    assert round(float(deviations), 1) in (2.6, 2.7, 3.5)


def test_two_heaps_with_a_gap_are_no_gaussian():
    rng = np.random.default_rng(5)
    for gap, expected in ((1.0, True), (8.0, False)):
        points = rng.normal(size=(400, 3)) + gap * (np.arange(400) >= 200)[:, None] * [1.0, 0, 0]
        both = Gaussians.from_labels(points, (np.arange(400) >= 200).astype(np.int64))
        halves = both.taken(np.array([0])), both.taken(np.array([1]))
        assert _merges(GaussianFit(), *halves) is expected


def test_no_cluster_reaches_beyond_the_largest_radius():
    finder = ClusterFinder(merge=MeanDistance(limit=3.0))
    points = _obstacles()
    labels, count = finder.grow(points)
    reaches = [_reach(points[labels == k]) for k in range(count)]
    for radius in (2.0, 1.0, 0.3):
        cut, cut_count = finder.cut(points, labels, count, radius)
        assert max(reaches) > radius
        assert max(_reach(points[cut == k]) for k in range(cut_count)) <= radius
        assert _is_refined(cut, labels)
        np.testing.assert_array_equal(np.unique(cut[cut >= 0]), np.arange(cut_count))
        np.testing.assert_array_equal(cut < 0, labels < 0)


def test_cuts_through_a_larger_radius_end_in_the_same_clusters():
    finder, points = ClusterFinder(), _obstacles()
    labels, count = finder.grow(points)
    direct, _ = finder.cut(points, labels, count, 0.7)
    for radius in (5.0, 2.5, 1.4, 0.7):
        labels, count = finder.cut(points, labels, count, radius)
    assert partition(labels) == partition(direct)


def test_the_order_of_points_changes_no_cluster():
    finder, points = ClusterFinder(), _obstacles()
    labels, count = finder.label(points)
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(points))
        shuffled, shuffled_count = finder.label(points[order])
        back = np.empty_like(shuffled)
        back[order] = shuffled
        assert shuffled_count == count
        assert partition(back) == partition(labels)


def test_the_order_of_points_changes_no_cut_through_a_point():
    # Evenly spaced points put one on the plane through their mean, where rounding decides.
    finder = ClusterFinder()
    rng = np.random.default_rng(0)
    for _ in range(40):
        lattice = np.zeros((int(rng.integers(3, 9)), 3))
        lattice[:, 0] = 0.1 * np.arange(len(lattice)) + rng.uniform(0.0, 50.0)
        order = rng.permutation(len(lattice))
        together = np.zeros(len(lattice), np.int64)
        straight, _ = finder.cut(lattice, together, 1, 0.11)
        shuffled, _ = finder.cut(lattice[order], together, 1, 0.11)
        back = np.empty_like(shuffled)
        back[order] = shuffled
        assert partition(back) == partition(straight)


def test_small_clusters_are_dropped_and_the_others_numbered_without_gaps():
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


def test_all_points_in_one_place_are_one_cluster():
    labels, count = ClusterFinder().label(np.full((100, 3), 3.3))
    assert (count, set(labels)) == (1, {0})


def _obstacles():
    points = street(0, 4000)
    return points[points[:, 2] > -1.5]


def _reach(points):
    return np.linalg.norm(points - points.mean(axis=0), axis=1).max()


def _is_refined(fine, coarse):
    return all(len(set(coarse[fine == k])) == 1 for k in set(fine[fine >= 0]))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: MeanDistance(limit=0.0), "limit must be positive, got 0.0 m"),
        (lambda: L2Distance(least_correlation=1.5), "least_correlation must lie between 0 and 1"),
        (lambda: L2Distance(min_deviation=0.0), "deviation_floor must be positive, got 0.0 m"),
        (lambda: GaussianFit(limit=-1.0), "limit must be positive, got -1.0"),
        (lambda: GaussianFit(min_deviation=0.0), "deviation_floor must be positive, got 0.0 m"),
        (lambda: ClusterFinder(max_radius=0.0), "largest_radius must be positive, got 0.0 m"),
        (lambda: ClusterFinder(min_points=0), "least_count must be"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()


def test_gaussians_are_those_of_the_clusters_cut_to_each_radius():
    finder, points = ClusterFinder(min_points=4), _obstacles()
    labels, count = finder.grow(points)
    radii = [5.0, 1.4, 0.7]
    for radius, found in zip(radii, finder.gaussians(points, labels, count, radii), strict=True):
        cut, _ = finder.cut(points, labels, count, radius)
        expected = Gaussians.from_labels(points, cut, 4)
        assert len(found) == len(expected) > 5
        ours, theirs = (np.lexsort(one.means.T) for one in (found, expected))
        np.testing.assert_array_equal(found.counts[ours], expected.counts[theirs])
        np.testing.assert_allclose(found.means[ours], expected.means[theirs], atol=1e-12)
        np.testing.assert_allclose(
            found.covariances[ours], expected.covariances[theirs], atol=1e-12
        )
