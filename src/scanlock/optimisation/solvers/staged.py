"""One objective after the other, each from the pose where the last one ended."""

from collections.abc import Iterable
from dataclasses import replace

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver

Stage = tuple[Solver, Objective]
"""What is minimised, and by which settings."""


def minimise_staged(stages: Iterable[Stage], start: Pose) -> Solution:
    """Return the solution of the last stage where anything meets, with the history of all.

    Where nothing meets at any stage, the start is returned untouched. There must be a stage.
    """
    history = list[Iteration]()
    pose, best = start, None
    for solver, objective in stages:
        solution = solver.minimise(objective, pose)
        history.extend(solution.history)
        if best is None or solution.reason is not StopReason.EMPTY_OBJECTIVE:
            pose, best = solution.pose, replace(solution, objective=objective)
    assert best is not None
    return replace(best, history=tuple(history))


def with_tolerance(solver: Solver, step: float) -> Solver:
    """Return the solver with a stopping step of no less than `step` [m]: others go on."""
    criteria = solver.criteria
    return replace(
        solver, criteria=replace(criteria, step_tolerance=max(criteria.step_tolerance, step))
    )
