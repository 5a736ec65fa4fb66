"""Printed form of a registration result."""

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from scanlock.cli.console import Facts, print_facts, print_line, print_status, print_table

if TYPE_CHECKING:
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
    remarks: Sequence[str] = (),
    verbose: bool = False,
) -> None:
    """Print a result: status, accuracy and pose first; metrics, times and notes if verbose.

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
    remarks : sequence of str
        Further notes, always printed.
    verbose : bool
        Whether to print metrics, candidates, times and the notes on the scans.
    """
    rows = result.summary_rows()[1:]
    if not result.ok:
        rows.insert(0, ("reason", result.reason))
    if truth is not None:
        rows.insert(1, ("error", _error(result.target_from_source, truth)))
    matrix = [value for name, value in rows if name == "pose"]
    rows = [row for row in rows if row[0] != "pose"]
    if verbose:
        rows += [("source", f"{source} (moves)"), ("target", f"{target} (stays)")]
        rows += [row for row in result.detail_rows() if result.ok or row[0] != "reason"]
        rows += _local_pose(result)
    rows.append(("time", _time(result.timings, first_stage, compiled, verbose)))
    rows.extend(("note", note) for note in [*remarks, *_notes(result, verbose)])
    print_status(result.status.value.replace("_", " "), "source onto target", good=result.ok)
    print_facts(rows)
    for text in matrix:
        # Not indented or wrapped, to copy into other tools.
        print_line("target from source [m]:")
        print_line(text)


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


def _error(pose: "Pose", truth: "Pose") -> str:
    metres, radians = pose.distance(truth)
    return f"{100 * metres:.2f} cm and {math.degrees(radians):.3f} deg from the exact pose"


def _notes(result: "RegistrationResult", verbose: bool) -> list[str]:
    """Return the notes; those on the preparation of a scan only if verbose or if it failed."""
    if verbose or not result.ok:
        return list(result.notes)
    return [note for note in result.notes if not note.startswith(("source: ", "target: "))]


def _local_pose(result: "RegistrationResult") -> Facts:
    """Return the pose between coordinates near zero, for tools with single precision."""
    from scanlock.registration.display import matrix_lines, triple

    origins = result.origins
    if not (origins.is_on_map or origins.target_origin.any()):
        return []
    about = f"{triple(origins.source_origin, 0)} and {triple(origins.target_origin, 0)} m"
    rows = "\n".join(matrix_lines(result.local_target_from_source))
    return [("local pose", f"between source and target minus {about}:\n{rows}")]


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
