"""Printed form of a registration result."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from scanlock.cli.console import Facts, print_facts, print_status, print_table

if TYPE_CHECKING:
    from scanlock.arrays import Vector
    from scanlock.geometry.pose import Pose
    from scanlock.registration.result import RegistrationResult


def show_registration(
    result: "RegistrationResult",
    source: str,
    target: str,
    *,
    first_stage: tuple[str, float],
    compiled: bool,
    truth: "Pose | None" = None,
    verbose: bool = False,
) -> None:
    """Print a result: status, reason and pose; metrics, times and notes on scans if verbose.

    Parameters
    ----------
    result : RegistrationResult
    source, target : str
        Names of the scans.
    first_stage : str and float [s]
        Name and time of reading or simulating the scans, which the total leaves out.
    compiled : bool
        Whether kernels were compiled in between.
    truth : Pose, optional
        The true pose, if known.
    verbose : bool
        Whether to print metrics, candidates, times and the notes on the scans.
    """
    from scanlock.registration.display import direction_rows, metric_rows

    rows: Facts = [
        ("reason", result.reason),
        ("source", f"{source} (moves)"),
        ("target", f"{target} (stays)"),
        *_motion(result),
    ]
    if truth is not None:
        rows.append(("error", _error(result.target_from_source, truth)))
    rows.append(("probability", f"{result.probability:.3f} that the pose is right"))
    rows.extend(direction_rows(result.degenerate_directions))
    if result.covariance is not None:
        rows.append(("deviation", result.covariance.as_text()))
    rows.extend(_pose(result))
    if truth is not None:
        rows.append(("truth", _matrix(truth)))
    if verbose:
        rows.append(("method", f"{result.method}, {result.evaluations} evaluations"))
        rows.extend(metric_rows(result.metrics))
        if result.candidates:
            rows.append(("candidates", _candidates(result)))
    rows.append(("time", _time(result.timings, first_stage, compiled, verbose)))
    rows.extend(("note", note) for note in _notes(result, verbose))
    print_status(result.status.value.replace("_", " "), "source onto target", good=result.ok)
    print_facts(rows)


def show_history(result: "RegistrationResult") -> None:
    """Print every evaluation of the objective, grouped by runs of the solver."""
    heads = ("run", "evaluation", "value", "step [m]", "gradient", "accepted")
    rows = [
        [
            str(step["run"]),
            str(number),
            f"{step['value']:.6f}",
            f"{step['step_norm_m']:.2e}",
            f"{step['gradient_norm']:.2e}",
            "yes" if step["accepted"] else "no",
        ]
        for number, step in enumerate(history_content(result), start=1)
    ]
    print_table(heads, rows)


def history_content(result: "RegistrationResult") -> list[dict[str, Any]]:
    """Return every evaluation of the objective as plain numbers for JSON.

    The solver runs once at each scale of each start. A run begins with the evaluation of its
    initial pose, which is not a step.
    """
    content: list[dict[str, Any]] = []
    run = 0
    for step in result.history:
        run += step.step_norm == 0.0
        content.append(
            {
                "run": run,
                "value": step.value,
                "step_norm_m": step.step_norm,
                "gradient_norm": step.gradient_norm,
                "accepted": step.accepted,
            }
        )
    return content


def _motion(result: "RegistrationResult") -> Facts:
    from scanlock.geometry.rotations import log_rotation

    pose, point = result.target_from_source, result.origins.reference_point
    shift = result.origins.shift(pose, point)
    turn = [math.degrees(radians) for radians in log_rotation(pose.rotation)]
    about = f" at the centroid, {_triple(point, 0)} m" if result.origins.is_on_map else ""
    return [
        ("translation", f"{math.hypot(*shift):.3f} m: {_triple(shift, 3)} along x, y, z{about}"),
        ("rotation", f"{math.hypot(*turn):.3f} deg: {_triple(turn, 3)} about x, y, z"),
    ]


def _error(pose: "Pose", truth: "Pose") -> str:
    metres, radians = pose.distance(truth)
    return f"{100 * metres:.2f} cm and {math.degrees(radians):.3f} deg from the exact pose"


def _triple(values: "Vector | list[float]", digits: int) -> str:
    # Adding zero turns -0.0 into 0.0.
    return ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)


def _notes(result: "RegistrationResult", verbose: bool) -> list[str]:
    """Return the notes; those on the preparation of a scan only if verbose or if it failed."""
    if verbose or not result.ok:
        return list(result.notes)
    return [note for note in result.notes if not note.startswith(("source: ", "target: "))]


def _candidates(result: "RegistrationResult") -> str:
    return f"{len(result.candidates)}, the best by {result.candidates[0].proposed_by}"


def _pose(result: "RegistrationResult") -> Facts:
    title = "target from source: rotation and translation [m]"
    origins = result.origins
    if not (origins.is_on_map or origins.target_origin.any()):
        return [("pose", f"{title}\n{_matrix(result.target_from_source)}")]
    # At the coordinates of a map the seventh digit of a rotation is metres.
    full = "\n".join(
        " ".join(f"{value + 0.0:.17g}" for value in row)
        for row in result.target_from_source.matrix[:3]
    )
    about = f"{_triple(origins.target_origin, 0)} and {_triple(origins.source_origin, 0)} m"
    local = f"the same about the origins {about}\n{_matrix(result.local_target_from_source)}"
    return [("pose", f"{title}\n{full}"), ("local pose", local)]


def _matrix(pose: "Pose") -> str:
    rows = pose.matrix[:3]
    width = max(len(f"{value:.4f}") for value in rows[:, 3])
    return "\n".join(
        " ".join(f"{value + 0.0:9.6f}" for value in row[:3]) + f"  {row[3]:{width}.4f}"
        for row in rows
    )


def _time(
    timings: Mapping[str, float], first: tuple[str, float], compiled: bool, verbose: bool
) -> str:
    stages = dict(timings)
    total = f"{1e3 * stages.pop('total'):.0f} ms"
    remark = "\nmost of it for compiling; later runs are faster" if compiled else ""
    if not verbose:
        return f"{total}{remark}"
    split = ", ".join(f"{name} {1e3 * seconds:.0f}" for name, seconds in stages.items())
    name, seconds = first
    return f"{total}: {split}; before that {name} {1e3 * seconds:.0f}{remark}"
