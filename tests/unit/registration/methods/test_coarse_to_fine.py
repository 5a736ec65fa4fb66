import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria, StopReason
from scanlock.optimisation.solvers.newton import Newton
from scanlock.optimisation.solvers.problem import Quadratic
from scanlock.registration.methods.coarse_to_fine import (
    DEFAULT_SCALES,
    PAPER_SCALES,
    CoarseToFine,
    Scale,
)


class _Bowl:
    """A bowl about a point on the x axis, of the given curvature."""

    def __init__(self, minimum, curvature=1.0):
        self.minimum, self.curvature = minimum, curvature
        self.starts = []

    def linearise(self, pose):
        self.starts.append(pose)
        gap = pose.translation - [self.minimum, 0.0, 0.0]
        hessian = self.curvature * np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        gradient = np.append(self.curvature * gap, np.zeros(3))
        return Quadratic(0.5 * self.curvature * gap @ gap - 1e3, gradient, hessian)


_SCALES = tuple(Scale(smoothing=blur, max_radius=2.0) for blur in (4.0, 1.0, 0.0))


def test_each_scale_goes_on_from_the_pose_of_the_one_before():
    bowls = [_Bowl(1.0), _Bowl(2.0), _Bowl(2.5)]
    solution = CoarseToFine(scales=_SCALES).minimise(bowls.__getitem__, Pose.identity())
    assert bowls[0].starts[0] == Pose.identity()
    for bowl, minimum in zip(bowls[1:], (1.0, 2.0), strict=True):
        np.testing.assert_allclose(bowl.starts[0].translation, [minimum, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(solution.pose.translation, [2.5, 0.0, 0.0], atol=1e-6)
    assert [entry.pose for entry in solution.history] == [
        pose for bowl in bowls for pose in bowl.starts
    ]


def test_blurred_scales_stop_at_a_share_of_their_blur_and_the_sharp_one_at_the_tolerance():
    schedule = CoarseToFine(
        scales=_SCALES,
        coarse_tolerance=0.1,
        solver=Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-30, step_tolerance=1e-3)),
    )
    # Steps of 0.3 m and of 0.03 m: too small to evaluate at 4 m, at 1 m only the second.
    for step, evaluations in ((0.3, [1, 2, 2]), (0.03, [1, 1, 2])):
        bowls = [_Bowl(step), _Bowl(2.0 * step), _Bowl(3.0 * step)]
        solution = schedule.minimise(bowls.__getitem__, Pose.identity())
        assert [len(bowl.starts) for bowl in bowls] == evaluations
        np.testing.assert_allclose(solution.pose.translation, [3.0 * step, 0.0, 0.0], atol=1e-9)


_TWO_ENTRIES = (_SCALES[0], Scale(smoothing=1.0, max_radius=2.0, is_entry=True), _SCALES[2])


def test_a_descent_that_comes_to_where_another_was_goes_no_further():
    bowls = [_Bowl(1.0), _Bowl(2.0), _Bowl(2.5)]
    solution = CoarseToFine(scales=_TWO_ENTRIES).minimise(bowls.__getitem__, Pose.identity())
    np.testing.assert_allclose(solution.pose.translation, [2.5, 0.0, 0.0], atol=1e-6)
    # Two evaluations reach the minimum of a bowl: in the middle twice, in the others once.
    assert [len(bowl.starts) for bowl in bowls] == [2, 4, 2]
    assert len(solution.history) == 8


class _Wells(_Bowl):
    """Two bowls side by side, of which the right one is deeper by `lead`."""

    def __init__(self, lead):
        super().__init__(2.0)
        self.other, self.lead = _Bowl(-2.0), lead

    def linearise(self, pose):
        if pose.translation[0] <= 0.0:
            return self.other.linearise(pose)
        at = super().linearise(pose)
        return Quadratic(at.value - self.lead, at.gradient, at.hessian)


@pytest.mark.parametrize("lead", [1.0, -1.0])
def test_descents_that_end_elsewhere_both_go_on_and_the_lower_one_wins(lead):
    # The first scale leads to the right, while the start lies on the left.
    wells = [_Wells(lead), _Wells(lead)]
    solution = CoarseToFine(scales=_TWO_ENTRIES).minimise(
        [_Bowl(1.0), *wells].__getitem__, Pose.identity()
    )
    for well in wells:
        assert well.starts
        assert well.other.starts
    expected = [np.copysign(2.0, lead), 0.0, 0.0]
    np.testing.assert_allclose(solution.pose.translation, expected, atol=1e-6)


def test_the_objective_of_a_scale_is_made_once():
    made = []

    def objective_at(index):
        made.append(index)
        return _Wells(1.0) if index else _Bowl(1.0)

    CoarseToFine(scales=_TWO_ENTRIES).minimise(objective_at, Pose.identity())
    assert made == [0, 1, 2]


def test_the_reason_is_that_of_the_finest_scale():
    flat = [_Bowl(0.0), _Bowl(0.0), _Bowl(50.0, curvature=1e-3)]
    short = Newton(criteria=ConvergenceCriteria(max_iterations=2))
    schedule = CoarseToFine(scales=_SCALES, solver=short)
    solution = schedule.minimise(flat.__getitem__, Pose.identity())
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert len(solution.history) == 4


def test_the_named_schedules_are_valid_and_end_sharp():
    for scales in (DEFAULT_SCALES, PAPER_SCALES):
        assert CoarseToFine(scales=scales).scales[-1].smoothing == 0.0
    assert len(PAPER_SCALES) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CoarseToFine(scales=()), "blur must not grow"),
        (lambda: CoarseToFine(scales=_SCALES[::-1]), "blur must not grow"),
        (
            lambda: CoarseToFine(
                scales=(Scale(smoothing=1.0, max_radius=1.0), Scale(smoothing=0.0, max_radius=2.0))
            ),
            "largest_radius must not grow",
        ),
        (lambda: CoarseToFine(coarse_tolerance=2.0), "loose_step must lie between 0 and 1"),
        (lambda: Scale(smoothing=-1.0, max_radius=1.0), "blur must be at least 0.0 m"),
        (lambda: Scale(smoothing=0.0, max_radius=0.0), "largest_radius must be positive"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()
