import pytest

from scanlock.errors import InvalidInput
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason


def test_only_small_gradients_small_steps_and_given_poses_are_converged():
    converged = {reason for reason in StopReason if reason.is_converged}
    assert converged == {StopReason.GRADIENT_SMALL, StopReason.STEP_SMALL, StopReason.GIVEN}


@pytest.mark.parametrize("reason", StopReason)
def test_every_reason_is_a_sentence(reason):
    assert len(reason.value.split()) > 4


@pytest.mark.parametrize("name", ["gradient_tolerance", "step_tolerance", "max_iterations"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_settings_out_of_range_are_rejected_by_name(name, value):
    with pytest.raises(InvalidInput, match=name):
        ConvergenceCriteria(**{name: value})
