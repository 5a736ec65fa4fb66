import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.gaussian_overlap import overlaps
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.overlap import overlap_masks_and_score


def _met_and_score(target, source, limit):
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
        limit,
        16.0,
        25.0,
    )


def _meeting(target, source, limit):
    return _met_and_score(target, source, limit)[0]


@pytest.mark.parametrize("limit", [1.0, 9.0, 25.0])
@pytest.mark.parametrize("seed", range(5))
def test_meetings_match_the_definition(seed, limit):
    rng = np.random.default_rng(seed)
    spread = 4.0 * np.sqrt(limit)
    target, source = (gaussians(rng, 40, spread=spread, most=3.0) for _ in range(2))
    met = _meeting(target, source, limit)
    expected = overlaps(target.means, target.covariances, source.means, source.covariances, limit)
    np.testing.assert_array_equal(met, expected)
    other_way = overlaps(source.means, source.covariances, target.means, target.covariances, limit)
    np.testing.assert_array_equal(_met_and_score(target, source, limit)[1], other_way)
    assert len(set(expected)) == 2


def test_round_gaussians_meet_up_to_the_limit_itself():
    # For round Gaussians the bound that skips pairs is exact: nothing below may be skipped.
    rng = np.random.default_rng(1)
    target = gaussians(rng, 1, least=1.0, most=1.0)
    for share, expected in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        source = gaussians(rng, 1, least=2.0, most=2.0)
        direction = rng.normal(size=3)
        direction /= np.linalg.norm(direction)
        shift = target.means - source.means + 3.0 * np.sqrt(5.0) * share * direction
        moved = type(source)(source.means + shift, source.packed_covariances, source.counts)
        assert _meeting(target, moved, 9.0).tolist() == [expected]


def test_nothing_meets_no_target():
    rng = np.random.default_rng(2)
    some, none = gaussians(rng, 4), gaussians(rng, 0)
    assert not _meeting(none, some, 9.0).any()
    assert _meeting(some, none, 9.0).shape == (0,)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("sizes", [(40, 30), (300, 200), (1, 1)])
def test_the_score_is_that_of_the_definition(seed, sizes):
    rng = np.random.default_rng(seed)
    # Some within the window, some on its slope, some beyond.
    target, source = (gaussians(rng, size, spread=12.0, most=3.0) for size in sizes)
    score = _met_and_score(target, source, 9.0)[2]
    expected = -reference.d2d_value(Pose.identity(), target, source)
    np.testing.assert_allclose(score, expected, rtol=1e-11, atol=1e-300)
