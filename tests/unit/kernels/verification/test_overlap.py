import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.gaussian_overlap import overlaps
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.overlap import overlap_masks_and_score


def _masks_and_score(target, source, max_distance):
    return overlap_masks_and_score(
        target.means,
        target.packed_covariances,
        target.max_variances,
        target.weights(),
        read_only(np.argsort(target.means[:, 0])),
        source.means,
        source.packed_covariances,
        source.max_variances,
        source.weights(),
        max_distance,
        16.0,
        25.0,
    )


def _mask(target, source, max_distance):
    return _masks_and_score(target, source, max_distance)[0]


@pytest.mark.slow
@pytest.mark.parametrize("max_distance", [1.0, 9.0, 25.0])
@pytest.mark.parametrize("seed", range(5))
def test_overlap_masks_match_the_definition(seed, max_distance):
    rng = np.random.default_rng(seed)
    half_width = 4.0 * np.sqrt(max_distance)
    target, source = (
        gaussians(rng, 40, half_width=half_width, max_deviation=3.0) for _ in range(2)
    )
    found = _mask(target, source, max_distance)
    expected = overlaps(
        target.means, target.covariances, source.means, source.covariances, max_distance
    )
    np.testing.assert_array_equal(found, expected)
    expected_target = overlaps(
        source.means, source.covariances, target.means, target.covariances, max_distance
    )
    np.testing.assert_array_equal(
        _masks_and_score(target, source, max_distance)[1], expected_target
    )
    assert len(set(expected)) == 2


def test_round_gaussians_overlap_up_to_the_exact_threshold():
    # The bound that skips pairs is exact for round Gaussians.
    rng = np.random.default_rng(1)
    target = gaussians(rng, 1, min_deviation=1.0, max_deviation=1.0)
    for factor, expected in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        source = gaussians(rng, 1, min_deviation=2.0, max_deviation=2.0)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        shift = target.means - source.means + 3.0 * np.sqrt(5.0) * factor * direction
        moved = type(source)(source.means + shift, source.packed_covariances, source.counts)
        assert _mask(target, moved, 9.0).tolist() == [expected]


def test_empty_sets_have_no_overlap():
    rng = np.random.default_rng(2)
    some, none = gaussians(rng, 4), gaussians(rng, 0)
    assert not _mask(none, some, 9.0).any()
    assert _mask(some, none, 9.0).shape == (0,)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sizes", [(40, 30), (300, 200), (1, 1)])
def test_the_score_matches_the_definition(seed, sizes):
    rng = np.random.default_rng(seed)
    # Pairs inside the window, on its slope and beyond it.
    target, source = (gaussians(rng, size, half_width=12.0, max_deviation=3.0) for size in sizes)
    score = _masks_and_score(target, source, 9.0)[2]
    expected = -reference.d2d_value(Pose.identity(), target, source)
    np.testing.assert_allclose(score, expected, rtol=1e-11, atol=1e-300)
