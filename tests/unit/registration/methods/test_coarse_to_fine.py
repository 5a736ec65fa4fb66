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
    """A quadratic objective about a point on the x axis, of the given curvature."""

    def __init__(self, minimum, curvature=1.0):
        self.minimum, self.curvature = minimum, curvature
        self.starts = []

    def linearise(self, pose):
        self.starts.append(pose)
        offset = pose.translation - [self.minimum, 0.0, 0.0]
        hessian = self.curvature * np.diag([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
        gradient = np.append(self.curvature * offset, np.zeros(3))
        return Quadratic(0.5 * self.curvature * offset @ offset - 1e3, gradient, hessian)


_SCALES = tuple(Scale(smoothing=one, max_radius=2.0) for one in (4.0, 1.0, 0.0))


def test_each_scale_starts_at_the_pose_of_the_previous_one():
    bowls = [_Bowl(1.0), _Bowl(2.0), _Bowl(2.5)]
    solution = CoarseToFine(scales=_SCALES).minimise(bowls.__getitem__, Pose.identity())
    assert bowls[0].starts[0] == Pose.identity()
    for bowl, minimum in zip(bowls[1:], (1.0, 2.0), strict=True):
        np.testing.assert_allclose(bowl.starts[0].translation, [minimum, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(solution.pose.translation, [2.5, 0.0, 0.0], atol=1e-6)
    assert [entry.pose for entry in solution.history] == [
        pose for bowl in bowls for pose in bowl.starts
    ]


def test_the_step_tolerance_is_a_fraction_of_the_smoothing():
    schedule = CoarseToFine(
        scales=_SCALES,
        coarse_tolerance=0.1,
        solver=Newton(criteria=ConvergenceCriteria(gradient_tolerance=1e-30, step_tolerance=1e-3)),
    )
    # A step of 0.3 m is below the tolerance at 4 m of smoothing; one of 0.03 m also at 1 m.
    for step, evaluations in ((0.3, [1, 2, 2]), (0.03, [1, 1, 2])):
        bowls = [_Bowl(step), _Bowl(2.0 * step), _Bowl(3.0 * step)]
        solution = schedule.minimise(bowls.__getitem__, Pose.identity())
        assert [len(bowl.starts) for bowl in bowls] == evaluations
        np.testing.assert_allclose(solution.pose.translation, [3.0 * step, 0.0, 0.0], atol=1e-9)


_TWO_STARTS = (_SCALES[0], Scale(smoothing=1.0, max_radius=2.0, starts_here=True), _SCALES[2])


def test_a_refinement_stops_at_the_minimum_of_an_earlier_one():
    bowls = [_Bowl(1.0), _Bowl(2.0), _Bowl(2.5)]
    solution = CoarseToFine(scales=_TWO_STARTS).minimise(bowls.__getitem__, Pose.identity())
    np.testing.assert_allclose(solution.pose.translation, [2.5, 0.0, 0.0], atol=1e-6)
    # Two evaluations reach the minimum of a bowl; the middle scale is refined twice.
    assert [len(bowl.starts) for bowl in bowls] == [2, 4, 2]
    assert len(solution.history) == 8


class _Wells(_Bowl):
    """Two bowls side by side; the right one is lower by `lead`."""

    def __init__(self, lead):
        super().__init__(2.0)
        self.other, self.lead = _Bowl(-2.0), lead

    def linearise(self, pose):
        if pose.translation[0] <= 0.0:
            return self.other.linearise(pose)
        at = super().linearise(pose)
        return Quadratic(at.value - self.lead, at.gradient, at.hessian)


@pytest.mark.parametrize("lead", [1.0, -1.0])
def test_the_refinement_with_the_lower_minimum_is_chosen(lead):
    # The first scale converges to the right; the initial pose lies on the left.
    wells = [_Wells(lead), _Wells(lead)]
    solution = CoarseToFine(scales=_TWO_STARTS).minimise(
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

    CoarseToFine(scales=_TWO_STARTS).minimise(objective_at, Pose.identity())
    assert made == [0, 1, 2]


def test_the_stop_reason_is_that_of_the_last_scale():
    flat = [_Bowl(0.0), _Bowl(0.0), _Bowl(50.0, curvature=1e-3)]
    short = Newton(criteria=ConvergenceCriteria(max_iterations=2))
    schedule = CoarseToFine(scales=_SCALES, solver=short)
    solution = schedule.minimise(flat.__getitem__, Pose.identity())
    assert solution.reason is StopReason.ITERATION_LIMIT
    assert len(solution.history) == 4


def test_the_named_schedules_end_without_smoothing():
    for scales in (DEFAULT_SCALES, PAPER_SCALES):
        assert CoarseToFine(scales=scales).scales[-1].smoothing == 0.0
    assert len(PAPER_SCALES) == 1


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: CoarseToFine(scales=()), "smoothing must not increase"),
        (lambda: CoarseToFine(scales=_SCALES[::-1]), "smoothing must not increase"),
        (
            lambda: CoarseToFine(
                scales=(Scale(smoothing=1.0, max_radius=1.0), Scale(smoothing=0.0, max_radius=2.0))
            ),
            "max_radius must not increase",
        ),
        (lambda: CoarseToFine(coarse_tolerance=2.0), "coarse_tolerance must lie between 0 and 1"),
        (lambda: Scale(smoothing=-1.0, max_radius=1.0), "smoothing must be at least 0.0 m"),
        (lambda: Scale(smoothing=0.0, max_radius=0.0), "max_radius must be positive"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(make, message):
    with pytest.raises(InvalidInput, match=message):
        make()
