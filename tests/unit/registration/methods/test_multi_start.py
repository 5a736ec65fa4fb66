import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints, PosePrior
from scanlock.registration.methods.coarse_to_fine import Scale
from scanlock.registration.methods.multi_start import MultiStart
from scanlock.registration.search.hypothesis import Hypothesis

_TRUTH = yaw_pose(0.7, (3.0, -2.0, 0.2))
_WORLD = gaussians(np.random.default_rng(0), 60, spread=25.0, most=1.0)
_TARGET = (_WORLD, _WORLD)
_SOURCE = tuple(one.transformed(_TRUTH.inverse()) for one in _TARGET)


def _hypothesis(turn, shift):
    return Hypothesis(yaw_pose(turn, shift) @ _TRUTH, 1.0, f"off by {turn}")


_NEAR, _BESIDE = _hypothesis(0.03, (0.5, -0.4, 0.1)), _hypothesis(-0.02, (-0.3, 0.5, 0.0))
_WRONG = _hypothesis(1.5, (4.0, 0.0, 0.0))


def _follow(hypotheses, plausibility=lambda pose: 1.0, **settings):
    return MultiStart(**settings).refine(_TARGET, _SOURCE, hypotheses, UNCONSTRAINED, plausibility)


def test_a_hypothesis_close_by_ends_at_the_truth():
    [ended], history = _follow([_NEAR])
    assert ended.solution.pose.is_close(_TRUTH, translation=1e-5, rotation=1e-6)
    assert ended.proposed_by == _NEAR.proposed_by
    assert history[0].pose == _NEAR.pose
    assert len(history) >= len(ended.solution.history) + 2


def test_two_that_end_in_one_place_are_one():
    ended, _ = _follow([_NEAR, _BESIDE])
    assert len(ended) == 1


def test_the_worse_is_given_up_or_kept_behind_the_better():
    ended, _ = _follow([_WRONG, _NEAR])
    assert [one.proposed_by for one in ended] == [_NEAR.proposed_by]
    ended, _ = _follow([_WRONG, _NEAR], least_share=0.0)
    assert [one.proposed_by for one in ended] == [_NEAR.proposed_by, _WRONG.proposed_by]
    ended, _ = _follow([_WRONG, _NEAR], least_share=0.0, most=1)
    assert [one.proposed_by for one in ended] == [_NEAR.proposed_by]


def test_what_is_implausible_is_given_up():
    def plausibility(pose):
        return 1e-6 if pose.distance(_TRUTH)[0] < 0.5 else 1.0

    ended, _ = _follow([_WRONG, _NEAR], plausibility)
    assert [one.proposed_by for one in ended] == [_WRONG.proposed_by]


def test_a_prior_that_outweighs_the_scans_leaves_the_best():
    believed = PosePrior.from_deviations(yaw_pose(0.0, (0.0, 0.0, 9.0)) @ _TRUTH, 0.3, 0.1)
    # The height is locked, so that no descent can give in to it.
    constraints = Constraints(dof="xy+yaw", prior=believed)
    ended, _ = MultiStart().refine(_TARGET, _SOURCE, [_NEAR], constraints, lambda pose: 1.0)
    assert len(ended) == 1
    assert ended[0].solution.quadratic.value > 0.0


def test_where_nothing_meets_nothing_ends():
    far = Hypothesis(yaw_pose(0.0, (500.0, 0.0, 0.0)), 1.0, "far")
    assert _follow([far])[0] == []
    assert _follow([]) == ([], ())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"scales": ()}, "scales must not be empty"),
        ({"loose_step": 2.0}, "loose_step must lie"),
        ({"least_share": -0.1}, "least_share must lie"),
        ({"most": 0}, "most must be"),
        ({"apart": (0.0, 0.1)}, "apart must be positive, got 0.0 m"),
        ({"apart": (1.0, -0.1)}, "apart must be positive, got -0.1 rad"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        MultiStart(**settings)


def test_scales_are_those_of_the_settings():
    single = MultiStart(scales=(Scale(smoothing=2.0, max_radius=3.0),))
    ended, history = single.refine(
        _TARGET[:1], _SOURCE[:1], [_NEAR], UNCONSTRAINED, lambda pose: 1.0
    )
    assert len(history) == len(ended[0].solution.history)
