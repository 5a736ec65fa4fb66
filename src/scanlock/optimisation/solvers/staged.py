"""Multi-stage minimisation, coarse to fine: each stage starts at the pose of the last one."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver

Stage = tuple[Solver, Objective]
"""An objective and the solver that minimises it."""


def minimise_staged(stages: Iterable[Stage], start: Pose) -> Solution:
    """Return the solution of the last non-empty stage, with the history of all stages.

    The start is returned unchanged if the objectives of all stages are empty. At least one stage
    is needed.
    """
    history = list[Iteration]()
    pose, best = start, None
    for solver, objective in stages:
        solution = solver.minimise(objective, pose)
        history.extend(solution.history)
        if best is None or solution.reason is not StopReason.EMPTY_OBJECTIVE:
            pose, best = solution.pose, solution
    assert best is not None
    return replace(best, history=tuple(history))


def staged_solvers(solver: Solver, tolerances: Sequence[float]) -> list[Solver]:
    """Return the solver of each stage of a coarse-to-fine schedule.

    Stages before the last one have coarse step tolerances, since the next stage continues from
    their pose. The last stage has the tolerance of the solver.

    Parameters
    ----------
    solver : Solver
    tolerances : sequence of float [m]
        Step tolerance of each stage, raised to that of the solver; the last one is not used.
    """
    criteria = solver.criteria
    return [
        replace(solver, criteria=replace(criteria, step_tolerance=step))
        for step in stage_tolerances(criteria.step_tolerance, tolerances)
    ]


def stage_tolerances(tolerance: float, coarse: Sequence[float]) -> list[float]:
    """Return the step tolerance of each stage [m]: `tolerance` for the last, a coarse one before.

    The tolerance of an earlier stage is that in `coarse`, but at least `tolerance`.
    """
    return [*(max(tolerance, step) for step in coarse[:-1]), tolerance]
