"""``scanlock register``: the pose between two scan files."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scanlock.cli.method_options import MethodOptions
from scanlock.cli.option_types import CovarianceName, Flag
from scanlock.cli.result_files import ResultFiles
from scanlock.cli.scan_input import LoadedScan, Reading, system_notes
from scanlock.errors import InvalidInput, require_positive

if TYPE_CHECKING:
    from scanlock.arrays import Matrix
    from scanlock.geometry.pose import Pose
    from scanlock.optimisation.objectives.constraints import PosePrior
    from scanlock.registration.result import RegistrationResult


def register(
    source: Path,
    target: Path,
    /,
    *,
    how: MethodOptions | None = None,
    initial: Path | None = None,
    prior: Annotated[tuple[float, float] | None, Parameter(negative="")] = None,
    fix_degenerate: Flag = False,
    covariance: CovarianceName = "sandwich",
    threads: int = 1,
    json: Flag = False,
    verbose: Annotated[Flag, Parameter(name=["--verbose", "-v"])] = False,
    files: ResultFiles | None = None,
    reading: Reading | None = None,
) -> int:
    """Estimate the pose that maps the source onto the target, and verify it.

    Parameters
    ----------
    source : Path
        The scan that moves.
    target : Path
        The scan that stays.
    initial : Path
        Initial pose, target from source (4x4 matrix in text, .json or .npy), or the word identity.
    prior : tuple of float
        Standard deviations of the initial pose in metres and degrees.
    fix_degenerate : bool
        Keep degenerate directions, such as along a corridor, as in the initial pose.
    covariance : str
        Estimate of the accuracy: from the scatter between blocks of the scene (sandwich), from the
        curvature alone (hessian), from twelve more registrations (sampled), or none.
    threads : int
        Maximum number of threads; the result does not depend on it.
    json : bool
        Print the whole result as JSON, and nothing else.
    verbose : bool
        Also print metrics, times and every step of the solver.

    Returns
    -------
    int
        The exit code: 0 if the pose is verified, 2 if it is not.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_json, print_line
    from scanlock.cli.errors import complain
    from scanlock.cli.results import show_history, show_registration
    from scanlock.registration.register import register as registered
    from scanlock.registration.registry import named_method

    how, files = how or MethodOptions(), files or ResultFiles()
    files.check((source, target))
    begin = time.perf_counter()
    chosen = how.chosen()
    given, start = (None, None) if initial is None else _read_initial(initial)
    gaussian = None if prior is None else _prior(start, *prior)
    moving, fixed = ((reading or Reading()).load(path) for path in (source, target))
    read_time = time.perf_counter() - begin
    with compile_watch() as watch:
        result = registered(
            source=moving.returns,
            target=fixed.returns,
            method=chosen,
            # Uncorrected, so that a note of the result reports the correction.
            initial=given,
            dof=how.dof,
            prior=gaussian,
            fix_degenerate=fix_degenerate,
            covariance=False if covariance == "none" else covariance,
            threads=threads,
        )
    remarks = system_notes(moving, fixed)
    content = _content(result, moving, fixed, read_time, verbose)
    content["notes"] = [*remarks, *content["notes"]]
    if json:
        print_json(content)
    else:
        show_registration(
            result,
            moving.summary(),
            fixed.summary(),
            first_stage=("read", read_time),
            compiled=watch.compiled,
            remarks=remarks,
            verbose=verbose,
        )
        if verbose:
            show_history(result)
    # After the result is printed, which a full disk must not lose.
    for line in files.write(result, moving, fixed, content, named_method(chosen)[1], start):
        if not json:
            print_line(line)
        elif not line.startswith("wrote"):
            complain(line)
    return 0 if result.ok else 2


def _read_initial(path: Path) -> "tuple[Matrix, Pose]":
    """Return the matrix of the initial pose as it is in the file, and the pose."""
    from scanlock.geometry.pose import Pose
    from scanlock.io import read_pose_matrix

    if path == Path("identity") and not path.exists():
        return Pose.identity().matrix, Pose.identity()
    matrix = read_pose_matrix(path)
    return matrix, Pose.from_matrix(matrix)


def _prior(start: "Pose | None", metres: float, degrees: float) -> "PosePrior":
    from scanlock.optimisation.objectives.constraints import PosePrior

    for value, unit in ((metres, "m"), (degrees, "deg")):
        require_positive("--prior", value, unit=unit)
    if start is None:
        raise InvalidInput(
            "--prior needs --initial, the pose whose deviations it states; for scans that hardly "
            "moved, --initial identity"
        )
    return PosePrior.from_deviations(start, metres, math.radians(degrees))


def _content(
    result: "RegistrationResult",
    source: LoadedScan,
    target: LoadedScan,
    read_time: float,
    verbose: bool,
) -> dict[str, Any]:
    from scanlock.cli.results import history_content

    content = {
        "source": str(source.path),
        "target": str(target.path),
        **result.as_dict(),
        "read_s": read_time,
    }
    return {**content, "history": history_content(result)} if verbose else content
