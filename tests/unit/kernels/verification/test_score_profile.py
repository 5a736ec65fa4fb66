import numpy as np
import pytest

from reference import gaussian_scores as reference
from reference.samples import gaussians
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.kernels.verification.score_profile import scores_along_direction

_STEP, _STEPS = 0.5, 6


def _scores(target, source, direction, across):
    return scores_along_direction(
        target.means,
        target.packed_covariances,
        target.max_variances,
        target.weights(),
        read_only(np.argsort(target.means @ across)),
        source.means,
        source.packed_covariances,
        source.max_variances,
        source.weights(),
        read_only(direction),
        read_only(across),
        _STEP,
        _STEPS,
        16.0,
        25.0,
    )


@pytest.mark.parametrize("seed", range(4))
def test_scores_of_shifted_gaussians_match_the_definition(seed):
    rng = np.random.default_rng(seed)
    target, source = gaussians(rng, 12, half_width=3.0), gaussians(rng, 9, half_width=3.0)
    direction, across = np.linalg.qr(rng.normal(size=(3, 2)))[0].T.copy()
    found = _scores(target, source, direction, across)
    shifts = _STEP * np.arange(-_STEPS, _STEPS + 1)
    expected = [
        -reference.d2d_value(Pose(np.eye(3), shift * direction), target, source) for shift in shifts
    ]
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)
    assert max(expected) > 0.0


def test_empty_sets_have_zero_scores():
    rng = np.random.default_rng(0)
    none, some = gaussians(rng, 0), gaussians(rng, 3)
    x, y = np.eye(3)[:2]
    assert (_scores(none, some, x, y) == 0.0).all()
    assert (_scores(some, none, x, y) == 0.0).all()
