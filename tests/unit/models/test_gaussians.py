import pickle

import numpy as np
import pytest

from reference import moments as reference
from reference.samples import gaussians, rotated_covariances
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians, unpacked


def _scan(seed=0, count=500, clusters=7):
    rng = np.random.default_rng(seed)
    return rng.normal(5.0, [4.0, 2.0, 0.3], (count, 3)), rng.integers(-1, clusters, count)


def _union(first, second):
    """Moments of the union of two Gaussians, from those of each."""
    n, m = first.counts[0], second.counts[0]
    difference = first.means[0] - second.means[0]
    mean = (n * first.means[0] + m * second.means[0]) / (n + m)
    within = (n * first.covariances[0] + m * second.covariances[0]) / (n + m)
    return mean, within + n * m / (n + m) ** 2 * np.outer(difference, difference)


def test_each_cluster_has_the_moments_of_numpy():
    points, labels = _scan()
    found = Gaussians.from_labels(points, labels)
    for k in range(7):
        own = points[labels == k]
        assert found.counts[k] == len(own)
        np.testing.assert_allclose(found.means[k], own.mean(axis=0), rtol=1e-13)
        expected = np.cov(own.T, bias=True)
        np.testing.assert_allclose(found.covariances[k], expected, rtol=1e-11, atol=1e-13)


def test_the_moments_of_a_union_follow_from_those_of_two_clusters():
    points, labels = _scan(1, clusters=2)
    halves = Gaussians.from_labels(points, labels)
    together = Gaussians.from_labels(points, np.minimum(labels, 0))
    mean, covariance = _union(halves.taken(np.array([0])), halves.taken(np.array([1])))
    np.testing.assert_allclose(together.means[0], mean, rtol=1e-13)
    np.testing.assert_allclose(together.covariances[0], covariance, rtol=1e-11)
    assert together.counts[0] == halves.counts.sum()


def test_clusters_of_too_few_points_are_skipped_and_the_others_keep_their_order():
    points, _ = _scan(2, count=11)
    labels = np.array([0, 1, 1, 2, 2, 2, 4, 4, 4, 4, -1])
    kept = Gaussians.from_labels(points, labels, min_points=3)
    assert kept.counts.tolist() == [3, 4]
    np.testing.assert_allclose(kept.means[1], points[6:10].mean(axis=0))
    assert len(Gaussians.from_labels(points, labels, min_points=5)) == 0
    assert len(Gaussians.from_labels(points, np.full(11, -1))) == 0


def test_regularisation_raises_small_variances_and_keeps_the_axes():
    rng = np.random.default_rng(3)
    variances = np.array([[1e-8, 1e-4, 4.0], [0.0, 0.0, 0.0], [0.04, 1.0, 9.0]])
    covariances = rotated_covariances(rng, variances)
    sharp = Gaussians.from_covariances(rng.normal(size=(3, 3)), covariances, np.array([9, 1, 5]))
    raised = sharp.regularised(0.1)
    # Rounding of a product of matrices whose entries reach the largest variance.
    rounding = 1e-14 * 9.0
    expected = np.maximum(variances, 0.1**2)
    np.testing.assert_allclose(raised.variances, expected, atol=rounding)
    for before, after in zip(covariances, raised.covariances, strict=True):
        np.testing.assert_allclose(before @ after, after @ before, atol=10 * rounding)
        np.testing.assert_allclose(after, reference.regularised(before, 0.1), atol=10 * rounding)
        np.testing.assert_array_equal(after, after.T)
    np.testing.assert_array_equal(raised.means, sharp.means)
    np.testing.assert_array_equal(raised.counts, sharp.counts)


def test_a_ratio_raises_variances_to_a_fraction_of_the_largest():
    rng = np.random.default_rng(4)
    covariances = rotated_covariances(rng, np.array([[1e-6, 0.5, 9.0], [1e-6, 1e-6, 1e-6]]))
    raised = Gaussians.from_covariances(
        np.zeros((2, 3)), covariances, np.array([3, 3])
    ).regularised(0.1, ratio=0.01)
    np.testing.assert_allclose(raised.variances, [[0.09, 0.5, 9.0], [0.01, 0.01, 0.01]], rtol=1e-9)


def test_regularisation_changes_large_variances_by_rounding_only():
    some = gaussians(np.random.default_rng(5), 20, min_deviation=0.2)
    np.testing.assert_allclose(
        some.regularised(0.1).covariances, some.covariances, rtol=1e-12, atol=1e-12
    )


def test_scaling_multiplies_deviations_and_inflation_adds_variances():
    some = gaussians(np.random.default_rng(6), 20)
    np.testing.assert_allclose(some.scaled(3.0).variances, 9.0 * some.variances, rtol=1e-9)
    np.testing.assert_allclose(some.inflated(2.0).variances, some.variances + 4.0, rtol=1e-12)
    twice = some.inflated(3.0).inflated(4.0)
    np.testing.assert_allclose(twice.covariances, some.inflated(5.0).covariances, rtol=1e-12)
    np.testing.assert_array_equal(some.inflated(0.0).covariances, some.covariances)


def test_transformed_gaussians_are_those_of_the_transformed_points():
    points, labels = _scan(7)
    pose = Pose.from_step(np.array([3.0, -40.0, 1.0, 0.5, -2.0, 1.2]))
    moved = Gaussians.from_labels(points, labels).transformed(pose)
    expected = Gaussians.from_labels(pose.apply(points), labels)
    np.testing.assert_allclose(moved.means, expected.means, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(moved.covariances, expected.covariances, atol=1e-10)
    np.testing.assert_allclose(moved.max_variances, expected.max_variances, rtol=1e-10)


def test_weights_are_roots_of_counts_with_unit_norm():
    some = gaussians(np.random.default_rng(8), 20)
    np.testing.assert_allclose(np.linalg.norm(some.weights()), 1.0, rtol=1e-14)
    np.testing.assert_allclose(some.weights() ** 2, some.counts / some.counts.sum(), rtol=1e-13)
    assert gaussians(np.random.default_rng(8), 0).weights().shape == (0,)


def test_packed_matrices_are_complete():
    some = gaussians(np.random.default_rng(9), 20)
    np.testing.assert_array_equal(unpacked(some.packed_covariances), some.covariances)
    products = unpacked(some.packed_precisions) @ some.covariances
    # The condition number of a matrix with deviations 0.1 to 2 m is at most 400.
    np.testing.assert_allclose(products, np.tile(np.eye(3), (20, 1, 1)), atol=400 * 1e-14)
    largest = np.linalg.norm(some.covariances, 2, axis=(1, 2))
    np.testing.assert_allclose(some.max_variances, largest)


def test_every_array_is_read_only():
    some = gaussians(np.random.default_rng(10), 5)
    for derived in (
        some,
        some.regularised(0.1),
        some.scaled(2.0),
        some.inflated(1.0),
        some.taken(np.array([0, 3])),
        some.transformed(Pose.identity()),
        pickle.loads(pickle.dumps(some)),
    ):
        for name in (
            "means",
            "covariances",
            "counts",
            "packed_covariances",
            "packed_precisions",
            "variances",
            "max_variances",
        ):
            array = getattr(derived, name)
            assert not array.flags.writeable, name
            assert array.flags.c_contiguous, name


def test_pickled_gaussians_are_the_same():
    some = gaussians(np.random.default_rng(11), 5)
    again = pickle.loads(pickle.dumps(some))
    for name in ("means", "covariances", "counts"):
        np.testing.assert_array_equal(getattr(again, name), getattr(some, name))


def test_rows_are_taken_by_number_or_by_mask():
    some = gaussians(np.random.default_rng(12), 5)
    chosen = some.taken(np.array([4, 1]))
    np.testing.assert_array_equal(chosen.means, some.means[[4, 1]])
    mask = np.array([True, False, False, True, False])
    np.testing.assert_array_equal(some.taken(mask).counts, some.counts[mask])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g: g.regularised(0.0), "deviation must be positive, got 0.0 m"),
        (lambda g: g.regularised(0.1, ratio=-1.0), "ratio must be at least 0.0, got -1.0"),
        (lambda g: g.scaled(-2.0), "factor must be positive, got -2.0"),
        (lambda g: g.inflated(-0.5), "deviation must be at least 0.0 m, got -0.5 m"),
        (lambda g: g.inflated(float("nan")), "deviation must be at least 0.0 m, got nan m"),
        (
            lambda g: Gaussians.from_covariances(g.means, g.covariances[:2], g.counts),
            "means and packed covariances must have shapes",
        ),
        (
            lambda g: Gaussians.from_covariances(g.means, g.covariances, g.counts[:2]),
            r"counts must have shape \(5,",
        ),
        (
            lambda g: Gaussians.from_labels(g.means, np.zeros(5, np.int64), min_points=0),
            "min_points must be at least 1, got 0",
        ),
    ],
)
def test_invalid_values_are_rejected_by_name(call, message):
    with pytest.raises(InvalidInput, match=message):
        call(gaussians(np.random.default_rng(13), 5))


def test_weights_are_counts_to_a_power():
    counts = np.array([1, 16, 81])
    some = Gaussians.from_covariances(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), counts)
    for power in (0.0, 0.25, 1.0):
        weights = some.weights(power)
        np.testing.assert_allclose(weights / weights[0], counts**power, rtol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(weights), 1.0, rtol=1e-14)


def test_variances_are_those_of_regularised_scaled_and_inflated_gaussians():
    some = gaussians(np.random.default_rng(9), 40, min_deviation=0.01)
    for changed in (some.regularised(0.3, 0.1), some.scaled(2.5), some.inflated(0.7)):
        np.testing.assert_allclose(
            changed.variances, np.linalg.eigvalsh(changed.covariances), rtol=1e-9, atol=1e-12
        )
        assert not changed.variances.flags.writeable


@pytest.mark.parametrize("power", [0.25, 0.5, 1.0])
def test_merged_gaussians_are_the_mixtures_of_their_voxels(power):
    rng = np.random.default_rng(5)
    several = gaussians(rng, 60, half_width=6.0)
    merged = several.merged(3.0, power)
    voxels = np.floor(several.means / 3.0)
    assert 1 < len(merged) < len(several)
    assert len(merged) == len(np.unique(voxels, axis=0))
    weights = several.counts**power
    for mean, covariance, count in zip(
        merged.means, merged.covariances, merged.counts, strict=True
    ):
        own = np.flatnonzero((voxels == np.floor(mean / 3.0)).all(axis=1))
        np.testing.assert_allclose(count**power, weights[own].sum(), rtol=1e-12)
        fractions = weights[own] / weights[own].sum()
        np.testing.assert_allclose(mean, fractions @ several.means[own], rtol=1e-12)
        offsets = several.means[own] - mean
        expected = np.einsum("k,kij->ij", fractions, several.covariances[own])
        expected += np.einsum("k,ki,kj->ij", fractions, offsets, offsets)
        np.testing.assert_allclose(covariance, expected, rtol=1e-10, atol=1e-12)


def test_merging_does_not_change_a_gaussian_alone_in_its_voxel():
    several = gaussians(np.random.default_rng(6), 20, half_width=50.0)
    merged = several.merged(1e-6, 0.5)
    order = np.lexsort(several.means.T[::-1])
    np.testing.assert_allclose(merged.means, several.means[order], rtol=1e-12)
    np.testing.assert_allclose(merged.counts, several.counts[order], rtol=1e-12)
    assert len(several.taken(np.empty(0, np.int64)).merged(1.0, 0.5)) == 0


@pytest.mark.parametrize("name", ["voxel_size", "weight_power"])
def test_merging_requires_positive_parameters(name):
    several = gaussians(np.random.default_rng(6), 3)
    with pytest.raises(InvalidInput, match=f"{name} must be positive"):
        several.merged(**{"voxel_size": 1.0, "weight_power": 1.0, name: 0.0})


def test_the_with_most_points_gaussians_keep_their_order():
    points, labels = _scan(clusters=4)
    found = Gaussians.from_labels(points, labels)
    counted = Gaussians(found.means, found.packed_covariances, np.array([5, 9, 5, 7]))
    assert counted.with_most_points(4) is counted
    assert counted.with_most_points(3).counts.tolist() == [5, 9, 7]
    assert (counted.with_most_points(3).means == counted.means[[0, 1, 3]]).all()
