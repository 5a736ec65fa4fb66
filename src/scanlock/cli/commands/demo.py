"""``scanlock demo``: two simulated scans registered, beside the exact pose."""

import math
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from scanlock.registration.result import RegistrationResult
    from scanlock.simulation import SimulatedPair

_BASELINE = (14.0, 18.0)
"""Distance between the scans along the street [m]; the heading of the source is random."""


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("scanlock-demo"),
    seed: int = 1,
) -> int:
    """Register two simulated 64-beam scans of a street without an initial pose.

    Parameters
    ----------
    output : Path
        Folder for the scans, poses and picture.
    seed : int
        Seed of the street and the sensor poses; any whole number from 0.

    Returns
    -------
    int
        The exit code: 0 if the pose is verified, 2 if it is not.
    """
    import numpy as np

    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_line, waiting
    from scanlock.cli.results import show_registration
    from scanlock.registration.register import register
    from scanlock.simulation import scan_pair

    output.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    with compile_watch() as watch:
        with waiting("simulating a street and two scans of it"):
            pair = scan_pair("street", "hdl_64e", seed, baseline=_BASELINE, turn=math.pi)
        made = time.perf_counter() - begin
        with waiting("registering"):
            result = register(source=pair.source.points, target=pair.target.points)
    wrote = _write(output, pair, result)
    metres = float(np.linalg.norm(pair.target_from_source.translation))
    show_registration(
        result,
        f"simulated HDL-64E, {metres:.0f} m further on and turned, {len(pair.source):,} points",
        f"simulated HDL-64E in a street, {len(pair.target):,} points",
        first_stage=("simulate", made),
        compiled=watch.compiled,
        truth=pair.target_from_source,
    )
    for line in wrote:
        print_line(line)
    files = f"{output / 'source.ply'} {output / 'target.ply'}"
    print_line(f"the same from files: scanlock register {files}")
    return 0 if result.ok else 2


def _write(folder: Path, pair: "SimulatedPair", result: "RegistrationResult") -> list[str]:
    """Write scans, poses and picture, and return the lines to print."""
    from scanlock.errors import MissingExtra
    from scanlock.io import write_pose, write_scan
    from scanlock.report.canvas import require_figures, save_figure
    from scanlock.report.registration_figure import registration_figure

    for name, scan in (("source", pair.source), ("target", pair.target)):
        write_scan(folder / f"{name}.ply", scan.points)
    write_pose(folder / "pose.txt", result.target_from_source)
    write_pose(folder / "exact_pose.txt", pair.target_from_source)
    names = "source.ply, target.ply, pose.txt, exact_pose.txt"
    try:
        require_figures()
    except MissingExtra as missing:
        return [f"wrote {names} to {folder}", f"no picture: {missing}"]
    figure = registration_figure(
        result,
        source=pair.source.points,
        target=pair.target.points,
        truth=pair.target_from_source,
        close_up=False,
    )
    save_figure(folder / "picture.png", figure)
    return [f"wrote {names} and picture.png to {folder}"]
