"""``scanlock register``: the pose between two scan files."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scanlock.cli.option_types import CovarianceName, DofName, Flag, MethodName, OutputFile
from scanlock.cli.scan_input import LoadedScan, Reading
from scanlock.errors import require_positive

if TYPE_CHECKING:
    from scanlock.arrays import Matrix
    from scanlock.geometry.pose import Pose
    from scanlock.optimisation.objectives.constraints import PosePrior
    from scanlock.registration.result import RegistrationResult


def register(
    reference: Path,
    scene: Path,
    /,
    *,
    method: MethodName | None = None,
    settings: Path | None = None,
    initial: Path | None = None,
    dof: DofName = "xyz+rpy",
    prior: tuple[float, float] | None = None,
    fix_degenerate: Flag = False,
    covariance: CovarianceName | None = None,
    threads: int = 1,
    output: OutputFile = None,
    picture: Path | None = None,
    json: Flag = False,
    verbose: Annotated[Flag, Parameter(name=["--verbose", "-v"])] = False,
    reading: Reading | None = None,
) -> int:
    """Find the pose that carries the scene onto the reference, and whether to trust it.

    Parameters
    ----------
    reference : Path
        The scan that stays.
    scene : Path
        The scan that moves.
    method : str
        How to register; auto by default.
    settings : Path
        A method with settings of your own: TOML as scanlock settings prints it.
    initial : Path
        Pose to start from (4x4 matrix in text, .json or .npy); no motion by default.
    dof : str
        What may change of the initial pose: everything, or less for levelled scanners
        (xyz+yaw) and a flat world (xy+yaw).
    prior : tuple of float
        How sure the initial pose is: standard deviations in metres and in degrees.
    hold_weak : bool
        Leave what the scans do not hold, such as the way along a corridor, as in the initial pose.
    covariance : str
        Also tell how sure the pose is: by the scatter of independent parts (sandwich), by the
        curvature alone (hessian), or by twelve registrations more (sampled).
    threads : int
        How many threads may share the work; the result does not depend on it.
    output : Path
        Where to write the pose: .txt or .npy (4x4 matrix), or .json (whole result).
    picture : Path
        Where to draw both scans before and after: .png, .pdf or .svg.
    json : bool
        Print the whole result as JSON, and nothing else.
    verbose : bool
        Also show every step of the solver.

    Returns
    -------
    int
        The exit code: 0 for a pose to use unseen, 2 for one that is not to be trusted.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_json, print_line
    from scanlock.cli.method_option import chosen_method
    from scanlock.cli.output import (
        POSE_ENDINGS,
        require_apart,
        require_ending,
        require_picture,
        save_pose,
    )
    from scanlock.cli.results import show_history, show_registration
    from scanlock.registration.register import register as registered

    if output is not None:
        require_ending(output, POSE_ENDINGS, "the pose file")
        require_apart(output, (reference, scene))
    if picture is not None:
        require_picture(picture)
    begin = time.perf_counter()
    chosen = chosen_method(method, settings)
    given, start = (None, None) if initial is None else _read_initial(initial)
    belief = None if prior is None else _belief(start, *prior)
    target, source = ((reading or Reading()).load(path) for path in (reference, scene))
    read_time = time.perf_counter() - begin
    with compile_watch() as watch:
        result = registered(
            source=source.returns,
            target=target.returns,
            method=chosen,
            # Not as mended, so that the result can tell of it.
            initial=given,
            dof=dof,
            prior=belief,
            fix_degenerate=fix_degenerate,
            covariance=covariance,
            threads=threads,
        )
    content = _content(result, target, source, read_time, verbose)
    if output is not None:
        save_pose(output, result.target_from_source, content)
    if picture is not None:
        _draw(picture, target, source, result, start)
    if json:
        print_json(content)
        return 0 if result.ok else 2
    show_registration(
        result,
        target.summary(),
        source.summary(),
        first_stage=("read", read_time),
        compiled=watch.compiled,
    )
    if verbose:
        show_history(result)
    for path in (output, picture):
        if path is not None:
            print_line(f"wrote {path}")
    return 0 if result.ok else 2


def _read_initial(path: Path) -> "tuple[Matrix, Pose]":
    """Return the matrix of the pose to start from, and the pose; its rotation may need mending."""
    from scanlock.geometry.pose import Pose
    from scanlock.io import read_pose_matrix

    matrix = read_pose_matrix(path)
    return matrix, Pose.from_matrix(matrix)


def _belief(start: "Pose | None", metres: float, degrees: float) -> "PosePrior":
    from scanlock.geometry.pose import Pose
    from scanlock.optimisation.objectives.constraints import PosePrior

    for value, unit in ((metres, "m"), (degrees, "deg")):
        require_positive("--prior", value, unit=unit)
    return PosePrior.from_deviations(start or Pose.identity(), metres, math.radians(degrees))


def _content(
    result: "RegistrationResult",
    target: LoadedScan,
    source: LoadedScan,
    read_time: float,
    verbose: bool,
) -> dict[str, Any]:
    from scanlock.cli.results import history_content

    content = {
        "reference": str(target.path),
        "scene": str(source.path),
        **result.as_dict(),
        "read_s": read_time,
    }
    return {**content, "history": history_content(result)} if verbose else content


def _draw(
    path: Path,
    target: LoadedScan,
    source: LoadedScan,
    result: "RegistrationResult",
    start: "Pose | None",
) -> None:
    from scanlock.cli.output import make_room
    from scanlock.report.canvas import save_figure
    from scanlock.report.registration_figure import registration_figure

    make_room(path)
    save_figure(path, registration_figure(target.returns, source.returns, result, initial=start))
