import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.registration.methods.auto.multi_start import MultiStart
from scanlock.registration.methods.coarse_to_fine import Scale
from scanlock.registration.search.hypothesis import Hypothesis

_TRUTH = yaw_pose(0.7, (3.0, -2.0, 0.2))
_WORLD = gaussians(np.random.default_rng(0), 60, half_width=25.0, max_deviation=1.0)
_TARGET = (_WORLD, _WORLD)
_SOURCE = tuple(one.transformed(_TRUTH.inverse()) for one in _TARGET)


def _hypothesis(turn, shift):
    pose = yaw_pose(turn, shift) @ _TRUTH
    return Hypothesis(pose=pose, score=1.0, proposed_by=f"off by {turn}")


_NEAR, _BESIDE = _hypothesis(0.03, (0.5, -0.4, 0.1)), _hypothesis(-0.02, (-0.3, 0.5, 0.0))
_WRONG = _hypothesis(1.5, (4.0, 0.0, 0.0))


def _refine(hypotheses, plausibility=lambda pose: 1.0, **settings):
    return MultiStart(**settings).refine(_TARGET, _SOURCE, hypotheses, UNCONSTRAINED, plausibility)


def test_a_near_hypothesis_converges_to_the_truth():
    [refined], history = _refine([_NEAR])
    assert refined.solution.pose.is_close(_TRUTH, translation=1e-5, rotation=1e-6)
    assert refined.proposed_by == _NEAR.proposed_by
    assert history[0].pose == _NEAR.pose
    assert len(history) >= len(refined.solution.history) + 2


def test_hypotheses_that_converge_to_one_pose_are_merged():
    refined, _ = _refine([_NEAR, _BESIDE])
    assert len(refined) == 1


def test_a_low_score_is_dropped_or_sorted_last():
    refined, _ = _refine([_WRONG, _NEAR])
    assert [one.proposed_by for one in refined] == [_NEAR.proposed_by]
    refined, _ = _refine([_WRONG, _NEAR], min_score_ratio=0.0)
    assert [one.proposed_by for one in refined] == [_NEAR.proposed_by, _WRONG.proposed_by]
    refined, _ = _refine([_WRONG, _NEAR], min_score_ratio=0.0, max_kept=1)
    assert [one.proposed_by for one in refined] == [_NEAR.proposed_by]


def test_an_implausible_pose_is_dropped():
    def plausibility(pose):
        return 1e-6 if pose.distance(_TRUTH)[0] < 0.5 else 1.0

    refined, _ = _refine([_WRONG, _NEAR], plausibility)
    assert [one.proposed_by for one in refined] == [_WRONG.proposed_by]


def test_the_best_is_kept_even_if_a_prior_makes_its_score_negative():
    prior = PosePrior.from_deviations(yaw_pose(0.0, (0.0, 0.0, 9.0)) @ _TRUTH, 0.3, 0.1)
    # The height is locked, so the refinement cannot move towards the prior.
    constraints = Constraints(dof="xy+yaw", prior=prior)
    refined, _ = MultiStart().refine(_TARGET, _SOURCE, [_NEAR], constraints, lambda pose: 1.0)
    assert len(refined) == 1
    assert refined[0].solution.quadratic.value > 0.0


def test_a_hypothesis_without_correspondences_is_dropped():
    far = Hypothesis(pose=yaw_pose(0.0, (500.0, 0.0, 0.0)), score=1.0, proposed_by="far")
    assert _refine([far])[0] == []
    assert _refine([]) == ([], ())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scales": ()}, "scales must not be empty"),
        ({"coarse_tolerance": 2.0}, "coarse_tolerance must lie"),
        ({"min_score_ratio": -0.1}, "min_score_ratio must lie"),
        ({"max_kept": 0}, "max_kept must be"),
        ({"min_separation": (0.0, 0.1)}, "min_separation must be positive, got 0.0 m"),
        ({"min_separation": (1.0, -0.1)}, "min_separation must be positive, got -0.1 rad"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        MultiStart(**settings)


def test_each_scale_is_refined_once():
    single = MultiStart(scales=(Scale(smoothing=2.0, max_radius=3.0),))
    refined, history = single.refine(
        _TARGET[:1], _SOURCE[:1], [_NEAR], UNCONSTRAINED, lambda pose: 1.0
    )
    assert len(history) == len(refined[0].solution.history)


def test_few_gaussians_of_the_source_are_enough():
    [refined], _ = _refine([_NEAR], max_gaussians=20)
    assert refined.solution.pose.is_close(_TRUTH, translation=1e-4, rotation=1e-5)
