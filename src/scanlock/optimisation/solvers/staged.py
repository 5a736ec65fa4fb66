"""Multi-stage minimisation, coarse to fine: each stage starts at the pose of the last one."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective
from scanlock.optimisation.solvers.solution import Iteration, Solution
from scanlock.optimisation.solvers.solver import Solver


def minimise_staged(
    solver: Solver, objectives: Iterable[Objective], tolerances: Sequence[float], start: Pose
) -> Solution:
    """Minimise objectives one after the other, each from the pose of the previous one.

    Parameters
    ----------
    solver : Solver
        Solver of the last stage.
    objectives : iterable of Objective
        At least one, coarse to fine.
    tolerances : sequence of float [m]
        Step tolerance of each stage, as for `staged_solvers`.
    start : Pose
        Initial pose of the first stage.

    Returns
    -------
    Solution
        Solution of the last non-empty stage, with the history of all stages. Its pose is the start
        if all objectives are empty.
    """
    history = list[Iteration]()
    pose, best = start, None
    for stage_solver, objective in zip(staged_solvers(solver, tolerances), objectives, strict=True):
        solution = stage_solver.minimise(objective, pose)
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
