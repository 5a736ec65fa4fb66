"""Clusters are those of the paper's flood, whatever the seed bin and the order of the points."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reference import flood
from reference.grouping import partition
from scanlock.clouds.polar_grid import PolarGrid
from scanlock.segmentation.clusters import ClusterFinder, GaussianFit, L2Distance, MeanDistance

_SEEDS = st.integers(0, 2**32 - 1)


def _points(seed, count):
    """Points in clumps of a random size, in no lattice."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-9.0, 9.0, (max(1, count // 8), 3)) * [1.0, 1.0, 0.2]
    sizes = rng.uniform(0.05, 3.0, len(centres))
    chosen = rng.integers(len(centres), size=count)
    return centres[chosen] + sizes[chosen, None] * rng.normal(size=(count, 3))


@given(
    seed=_SEEDS,
    count=st.integers(0, 80),
    sectors=st.integers(3, 24),
    limit=st.floats(0.3, 5.0),
    test=st.sampled_from(["means", "densities", "fit"]),
)
def test_any_flood_gives_the_same_clusters(seed, count, sectors, limit, test):
    points = _points(seed, count)
    grid = PolarGrid(sectors=sectors, max_range=10.0, first_width=1.0)
    merge, combine = {
        "means": (
            MeanDistance(limit=limit),
            lambda a, b: flood.means_are_close(a, b, limit),
        ),
        "densities": (
            L2Distance(least_correlation=0.02 * limit, min_deviation=0.5),
            lambda a, b: flood.densities_correlate(a, b, 0.02 * limit, 0.5),
        ),
        "fit": (
            GaussianFit(limit=limit, min_deviation=0.5),
            lambda a, b: flood.one_gaussian_fits(a, b, limit, 0.5),
        ),
    }[test]
    labels, clusters = ClusterFinder(grid=grid, merge=merge).grow(points)
    expected = flood.flood(points, sectors, grid.edges, combine, np.random.default_rng(seed))
    assert partition(labels) == expected
    assert clusters == len(expected)


@given(seed=_SEEDS, count=st.integers(1, 200), radius=st.floats(0.05, 4.0))
def test_cut_clusters_are_small_nested_and_independent_of_order(seed, count, radius):
    points = _points(seed, count)
    finder = ClusterFinder()
    whole, parts = finder.grow(points)
    cut, cut_parts = finder.cut(points, whole, parts, radius)
    assert sorted(set(cut[cut >= 0])) == list(range(cut_parts))
    for rows in partition(cut):
        mine = points[sorted(rows)]
        reach = np.linalg.norm(mine - mine.mean(axis=0), axis=1).max()
        assert reach <= radius * (1 + 1e-12)

    through, through_parts = finder.cut(points, whole, parts, 2.7 * radius)
    through, _ = finder.cut(points, through, through_parts, radius)
    assert partition(through) == partition(cut)

    order = np.random.default_rng(seed).permutation(count)
    shuffled, _ = finder.cut(points[order], whole[order], parts, radius)
    back = np.empty_like(shuffled)
    back[order] = shuffled
    assert partition(back) == partition(cut)


@given(seed=_SEEDS, count=st.integers(0, 120), least_count=st.integers(1, 12))
@settings(max_examples=25)
def test_labels_have_no_gaps_and_no_small_cluster(seed, count, least_count):
    finder = ClusterFinder(min_points=least_count)
    labels, clusters = finder.label(_points(seed, count))
    assert labels.shape == (count,)
    sizes = np.bincount(labels[labels >= 0], minlength=clusters)
    assert len(sizes) == clusters
    assert (sizes >= least_count).all()
