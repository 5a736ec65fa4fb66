import pickle

import numpy as np
import pytest

from reference import moments as reference
from reference.samples import gaussians, turned_covariances
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians, unpacked


def _scan(seed=0, count=500, parts=7):
    rng = np.random.default_rng(seed)
    return rng.normal(5.0, [4.0, 2.0, 0.3], (count, 3)), rng.integers(-1, parts, count)


def _union(first, second):
    """Moments of two parts together, from those of each."""
    n, m = first.counts[0], second.counts[0]
    gap = first.means[0] - second.means[0]
    mean = (n * first.means[0] + m * second.means[0]) / (n + m)
    within = (n * first.covariances[0] + m * second.covariances[0]) / (n + m)
    return mean, within + n * m / (n + m) ** 2 * np.outer(gap, gap)


def test_each_part_has_the_moments_that_numpy_finds():
    points, labels = _scan()
    found = Gaussians.from_labels(points, labels)
    for part in range(7):
        mine = points[labels == part]
        assert found.counts[part] == len(mine)
        np.testing.assert_allclose(found.means[part], mine.mean(axis=0), rtol=1e-13)
        expected = np.cov(mine.T, bias=True)
        np.testing.assert_allclose(found.covariances[part], expected, rtol=1e-11, atol=1e-13)


def test_the_moments_of_a_union_follow_from_those_of_its_parts():
    points, labels = _scan(1, parts=2)
    halves = Gaussians.from_labels(points, labels)
    together = Gaussians.from_labels(points, np.minimum(labels, 0))
    mean, covariance = _union(halves.taken(np.array([0])), halves.taken(np.array([1])))
    np.testing.assert_allclose(together.means[0], mean, rtol=1e-13)
    np.testing.assert_allclose(together.covariances[0], covariance, rtol=1e-11)
    assert together.counts[0] == halves.counts.sum()


def test_parts_of_too_few_points_are_skipped_and_the_others_keep_their_order():
    points, _ = _scan(2, count=11)
    labels = np.array([0, 1, 1, 2, 2, 2, 4, 4, 4, 4, -1])
    kept = Gaussians.from_labels(points, labels, least_count=3)
    assert kept.counts.tolist() == [3, 4]
    np.testing.assert_allclose(kept.means[1], points[6:10].mean(axis=0))
    assert len(Gaussians.from_labels(points, labels, least_count=5)) == 0
    assert len(Gaussians.from_labels(points, np.full(11, -1))) == 0


def test_a_floor_raises_what_lies_below_it_and_keeps_the_axes():
    rng = np.random.default_rng(3)
    variances = np.array([[1e-8, 1e-4, 4.0], [0.0, 0.0, 0.0], [0.04, 1.0, 9.0]])
    covariances = turned_covariances(rng, variances)
    sharp = Gaussians.from_covariances(rng.normal(size=(3, 3)), covariances, np.array([9, 1, 5]))
    raised = sharp.regularised(0.1)
    # Rounding of a product of matrices whose entries reach the largest variance.
    rounding = 1e-14 * 9.0
    expected = np.maximum(variances, 0.1**2)
    np.testing.assert_allclose(raised.variances, expected, atol=rounding)
    for was, now in zip(covariances, raised.covariances, strict=True):
        np.testing.assert_allclose(was @ now, now @ was, atol=10 * rounding)
        np.testing.assert_allclose(now, reference.regularised(was, 0.1), atol=10 * rounding)
        np.testing.assert_array_equal(now, now.T)
    np.testing.assert_array_equal(raised.means, sharp.means)
    np.testing.assert_array_equal(raised.counts, sharp.counts)


def test_a_ratio_raises_to_a_share_of_the_largest_variance():
    rng = np.random.default_rng(4)
    covariances = turned_covariances(rng, np.array([[1e-6, 0.5, 9.0], [1e-6, 1e-6, 1e-6]]))
    raised = Gaussians.from_covariances(
        np.zeros((2, 3)), covariances, np.array([3, 3])
    ).regularised(0.1, ratio=0.01)
    np.testing.assert_allclose(raised.variances, [[0.09, 0.5, 9.0], [0.01, 0.01, 0.01]], rtol=1e-9)


def test_a_floor_already_kept_changes_nothing_beyond_rounding():
    some = gaussians(np.random.default_rng(5), 20, least=0.2)
    np.testing.assert_allclose(
        some.regularised(0.1).covariances, some.covariances, rtol=1e-12, atol=1e-12
    )


def test_scaling_multiplies_deviations_and_blurring_adds_variances():
    some = gaussians(np.random.default_rng(6), 20)
    np.testing.assert_allclose(some.scaled(3.0).variances, 9.0 * some.variances, rtol=1e-9)
    np.testing.assert_allclose(some.inflated(2.0).variances, some.variances + 4.0, rtol=1e-12)
    twice = some.inflated(3.0).inflated(4.0)
    np.testing.assert_allclose(twice.covariances, some.inflated(5.0).covariances, rtol=1e-12)
    np.testing.assert_array_equal(some.inflated(0.0).covariances, some.covariances)


def test_moved_gaussians_are_the_gaussians_of_the_moved_points():
    points, labels = _scan(7)
    pose = Pose.from_step(np.array([3.0, -40.0, 1.0, 0.5, -2.0, 1.2]))
    moved = Gaussians.from_labels(points, labels).transformed(pose)
    expected = Gaussians.from_labels(pose.apply(points), labels)
    np.testing.assert_allclose(moved.means, expected.means, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(moved.covariances, expected.covariances, atol=1e-10)
    np.testing.assert_allclose(moved.widths, expected.widths, rtol=1e-10)


def test_weights_are_roots_of_counts_of_unit_length():
    some = gaussians(np.random.default_rng(8), 20)
    np.testing.assert_allclose(np.linalg.norm(some.weights()), 1.0, rtol=1e-14)
    np.testing.assert_allclose(some.weights() ** 2, some.counts / some.counts.sum(), rtol=1e-13)
    assert gaussians(np.random.default_rng(8), 0).weights().shape == (0,)


def test_packed_forms_hold_the_whole_matrices():
    some = gaussians(np.random.default_rng(9), 20)
    np.testing.assert_array_equal(unpacked(some.packed_covariances), some.covariances)
    products = unpacked(some.packed_precisions) @ some.covariances
    # The condition number of a matrix with deviations 0.1 to 2 m is at most 400.
    np.testing.assert_allclose(products, np.tile(np.eye(3), (20, 1, 1)), atol=400 * 1e-14)
    np.testing.assert_allclose(some.widths, np.linalg.norm(some.covariances, 2, axis=(1, 2)))


def test_every_array_is_read_only():
    some = gaussians(np.random.default_rng(10), 5)
    for made in (
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
            "widths",
        ):
            array = getattr(made, name)
            assert not array.flags.writeable, name
            assert array.flags.c_contiguous, name


def test_a_pickle_holds_the_same_gaussians():
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
            lambda g: Gaussians.from_labels(g.means, np.zeros(5, np.int64), least_count=0),
            "least_count must be at least 1, got 0",
        ),
    ],
)
def test_values_out_of_range_are_refused_by_name(call, message):
    with pytest.raises(InvalidInput, match=message):
        call(gaussians(np.random.default_rng(13), 5))


def test_weights_are_counts_to_a_power():
    counts = np.array([1, 16, 81])
    some = Gaussians.from_covariances(np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)), counts)
    for power in (0.0, 0.25, 1.0):
        weights = some.weights(power)
        np.testing.assert_allclose(weights / weights[0], counts**power, rtol=1e-14)
        np.testing.assert_allclose(np.linalg.norm(weights), 1.0, rtol=1e-14)


def test_variances_follow_floors_scales_and_blurs():
    some = gaussians(np.random.default_rng(9), 40, least=0.01)
    for reshaped in (some.regularised(0.3, 0.1), some.scaled(2.5), some.inflated(0.7)):
        np.testing.assert_allclose(
            reshaped.variances, np.linalg.eigvalsh(reshaped.covariances), rtol=1e-9, atol=1e-12
        )
        assert not reshaped.variances.flags.writeable


@pytest.mark.parametrize("power", [0.25, 0.5, 1.0])
def test_merged_gaussians_are_the_mixtures_of_their_cubes(power):
    rng = np.random.default_rng(5)
    several = gaussians(rng, 60, spread=6.0)
    merged = several.merged(3.0, power)
    cubes = np.floor(several.means / 3.0)
    assert 1 < len(merged) < len(several)
    assert len(merged) == len(np.unique(cubes, axis=0))
    weights = several.counts**power
    for mean, covariance, count in zip(
        merged.means, merged.covariances, merged.counts, strict=True
    ):
        mine = np.flatnonzero((cubes == np.floor(mean / 3.0)).all(axis=1))
        np.testing.assert_allclose(count**power, weights[mine].sum(), rtol=1e-12)
        shares = weights[mine] / weights[mine].sum()
        np.testing.assert_allclose(mean, shares @ several.means[mine], rtol=1e-12)
        gaps = several.means[mine] - mean
        expected = np.einsum("k,kij->ij", shares, several.covariances[mine])
        expected += np.einsum("k,ki,kj->ij", shares, gaps, gaps)
        np.testing.assert_allclose(covariance, expected, rtol=1e-10, atol=1e-12)


def test_merging_leaves_alone_what_has_a_cube_to_itself():
    several = gaussians(np.random.default_rng(6), 20, spread=50.0)
    merged = several.merged(1e-6, 0.5)
    order = np.lexsort(several.means.T[::-1])
    np.testing.assert_allclose(merged.means, several.means[order], rtol=1e-12)
    np.testing.assert_allclose(merged.counts, several.counts[order], rtol=1e-12)
    assert len(several.taken(np.empty(0, np.int64)).merged(1.0, 0.5)) == 0


@pytest.mark.parametrize("name", ["width", "weight_power"])
def test_merging_needs_a_width_and_weights(name):
    several = gaussians(np.random.default_rng(6), 3)
    with pytest.raises(InvalidInput, match=f"{name} must be positive"):
        several.merged(**{"width": 1.0, "weight_power": 1.0, name: 0.0})
