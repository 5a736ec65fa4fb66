"""A registration as people read it."""

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
    reference: str,
    scene: str,
    *,
    first_stage: tuple[str, float],
    compiled: bool,
    truth: "Pose | None" = None,
) -> None:
    """Print a registration: the verdict first, then the pose, then how it came about.

    Parameters
    ----------
    result : Registration
    reference, scene : str
        What was registered, as it is to be called.
    first_stage : str and float [s]
        What it took to have the scans at all, which the total leaves out.
    compiled : bool
        Whether kernels were compiled meanwhile.
    truth : Pose, optional
        The true pose, if it is known.
    """
    from scanlock.registration.display import direction_rows, metric_rows

    status = result.status.value.replace("_", " ")
    rows: Facts = [
        ("why", result.reason),
        ("reference", f"{reference} (stays)"),
        ("scene", f"{scene} (moves)"),
        ("method", f"{result.method}, {result.iterations} evaluations"),
        *_motion(result),
    ]
    if truth is not None:
        rows.append(("error", _error(result.target_from_source, truth)))
    rows.append(("right", f"with a probability of {result.probability:.3f}"))
    rows.extend(metric_rows(result.metrics))
    rows.extend(direction_rows(result.degenerate_directions))
    if result.covariance is not None:
        rows.append(("deviation", result.covariance.as_text()))
    if result.candidates:
        rows.append(("chosen", _choice(result)))
    rows.extend(_pose(result))
    if truth is not None:
        rows.append(("truth", _matrix(truth)))
    rows.append(("time", _time(result.timings, first_stage, compiled)))
    rows.extend(("note", note) for note in result.notes)
    print_status(status, "scene onto reference", good=result.ok)
    print_facts(rows)


def show_history(result: "RegistrationResult") -> None:
    """Print every evaluation of the objective on the way, in the runs of the solver."""
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

    The solver runs once at each scale of each descent; a run begins by evaluating the pose that
    it is given, which is no step.
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

    pose, place = result.target_from_source, result.origins.place
    shift = result.origins.shift(pose, place)
    turn = [math.degrees(radians) for radians in log_rotation(pose.rotation)]
    about = f" at the centroid, {_triple(place, 0)} m" if result.origins.is_on_map else ""
    return [
        ("moved", f"{math.hypot(*shift):.3f} m: {_triple(shift, 3)} along x, y, z{about}"),
        ("turned", f"{math.hypot(*turn):.3f} deg: {_triple(turn, 3)} about x, y, z"),
    ]


def _error(pose: "Pose", truth: "Pose") -> str:
    metres, radians = pose.distance(truth)
    return f"{100 * metres:.2f} cm and {math.degrees(radians):.3f} deg from the exact pose"


def _triple(values: "Vector | list[float]", digits: int) -> str:
    # Adding zero turns -0.0 into 0.0.
    return ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)


def _choice(result: "RegistrationResult") -> str:
    found = f"by {result.candidates[0].proposed_by}"
    rivals = len(result.candidates) - 1
    return f"{found}; no rival" if rivals == 0 else f"{found}; {rivals} rivals"


def _pose(result: "RegistrationResult") -> Facts:
    said = "rotation and translation [m], reference from scene"
    frames = result.origins
    if not (frames.is_on_map or frames.target_origin.any()):
        return [("pose", f"{said}\n{_matrix(result.target_from_source)}")]
    # At the coordinates of a map the seventh digit of a rotation is metres.
    full = "\n".join(
        " ".join(f"{value + 0.0:.17g}" for value in row)
        for row in result.target_from_source.matrix[:3]
    )
    origins = f"{_triple(frames.target_origin, 0)} and {_triple(frames.source_origin, 0)} m"
    local = f"the same about the origins {origins}\n{_matrix(result.local_target_from_source)}"
    return [("pose", f"{said}\n{full}"), ("local pose", local)]


def _matrix(pose: "Pose") -> str:
    rows = pose.matrix[:3]
    width = max(len(f"{value:.4f}") for value in rows[:, 3])
    return "\n".join(
        " ".join(f"{value + 0.0:9.6f}" for value in row[:3]) + f"  {row[3]:{width}.4f}"
        for row in rows
    )


def _time(timings: Mapping[str, float], first: tuple[str, float], compiled: bool) -> str:
    stages = dict(timings)
    total = stages.pop("total")
    split = ", ".join(f"{name} {1e3 * seconds:.0f}" for name, seconds in stages.items())
    remark = "\nmost of it for compiling, which later runs need not" if compiled else ""
    name, seconds = first
    return f"{1e3 * total:.0f} ms: {split}; before that {name} {1e3 * seconds:.0f}{remark}"
