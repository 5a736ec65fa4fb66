"""Laws of clustering: independence of the first bin and of the order of the points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference import flood
from reference.grouping import partition
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.segmentation.clusters import ClusterFinder, GaussianFit, L2Distance, MeanDistance

pytestmark = pytest.mark.slow

_SEEDS = st.integers(0, 2**32 - 1)


def _points(seed, count):
    """Points in groups of random size and position."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-9.0, 9.0, (max(1, count // 8), 3)) * [1.0, 1.0, 0.2]
    sizes = rng.uniform(0.05, 3.0, len(centres))
    chosen = rng.integers(len(centres), size=count)
    return centres[chosen] + sizes[chosen, None] * rng.normal(size=(count, 3))


@given(
    seed=_SEEDS,
    count=st.integers(0, 80),
    sectors=st.integers(3, 24),
    threshold=st.floats(0.3, 5.0),
    test=st.sampled_from(["means", "densities", "fit"]),
)
def test_greedy_growth_gives_the_same_clusters(seed, count, sectors, threshold, test):
    points = _points(seed, count)
    grid = PolarGrid(sectors=sectors, max_range=10.0, first_width=1.0)
    merge, combine = {
        "means": (
            MeanDistance(max_distance=threshold),
            lambda a, b: flood.means_are_close(a, b, threshold),
        ),
        "densities": (
            L2Distance(min_correlation=0.02 * threshold, min_deviation=0.5),
            lambda a, b: flood.densities_correlate(a, b, 0.02 * threshold, 0.5),
        ),
        "fit": (
            GaussianFit(max_mahalanobis=threshold, min_deviation=0.5),
            lambda a, b: flood.one_gaussian_fits(a, b, threshold, 0.5),
        ),
    }[test]
    labels, clusters = ClusterFinder(grid=grid, merge=merge).grow(points)
    expected = flood.flood(points, sectors, grid.edges, combine, np.random.default_rng(seed))
    assert partition(labels) == expected
    assert clusters == len(expected)


@given(seed=_SEEDS, count=st.integers(1, 200), radius=st.floats(0.05, 4.0))
def test_split_clusters_are_small_nested_and_independent_of_order(seed, count, radius):
    points = _points(seed, count)
    finder = ClusterFinder()
    labels, clusters = finder.grow(points)
    split, split_count = finder.split(points, labels, clusters, radius)
    assert sorted(set(split[split >= 0])) == list(range(split_count))
    for rows in partition(split):
        own = points[sorted(rows)]
        largest = np.linalg.norm(own - own.mean(axis=0), axis=1).max()
        assert largest <= radius * (1 + 1e-12)

    coarse, coarse_count = finder.split(points, labels, clusters, 2.7 * radius)
    nested, _ = finder.split(points, coarse, coarse_count, radius)
    assert partition(nested) == partition(split)

    order = np.random.default_rng(seed).permutation(count)
    shuffled, _ = finder.split(points[order], labels[order], clusters, radius)
    restored = np.empty_like(shuffled)
    restored[order] = shuffled
    assert partition(restored) == partition(split)


@given(seed=_SEEDS, count=st.integers(0, 120), min_points=st.integers(1, 12))
@settings(max_examples=25)
def test_labels_are_contiguous_and_no_cluster_is_small(seed, count, min_points):
    finder = ClusterFinder(min_points=min_points)
    labels, clusters = finder.label(_points(seed, count))
    assert labels.shape == (count,)
    sizes = np.bincount(labels[labels >= 0], minlength=clusters)
    assert len(sizes) == clusters
    assert (sizes >= min_points).all()
