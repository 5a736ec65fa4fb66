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
"""How far apart along the street the two scans are [m]; the scene looks anywhere."""


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("scanlock-demo"),
    seed: int = 1,
) -> int:
    """Register two simulated 64-beam scans of a street, no start given, beside the exact pose.

    Parameters
    ----------
    output : Path
        Folder for the two scans, the poses and the picture.
    seed : int
        Decides the street and the places; any whole number from 0.

    Returns
    -------
    int
        The exit code: 0 for a pose to use unseen, 2 for one that is not to be trusted.
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
        f"simulated HDL-64E, street, {len(pair.target):,} points",
        f"the same {metres:.0f} m on, turned, {len(pair.source):,} points",
        first_stage=("simulate", made),
        compiled=watch.compiled,
        truth=pair.target_from_source,
    )
    for line in wrote:
        print_line(line)
    files = f"{output / 'reference.ply'} {output / 'scene.ply'}"
    print_line(f"now the same from files: scanlock register {files}")
    return 0 if result.ok else 2


def _write(folder: Path, pair: "SimulatedPair", result: "RegistrationResult") -> list[str]:
    """Write what the demo is about and return what to say of it."""
    from scanlock.errors import MissingExtra
    from scanlock.io import write_pose, write_scan
    from scanlock.report.canvas import require_figures, save_figure
    from scanlock.report.registration_figure import registration_figure

    for name, scan in (("reference", pair.target), ("scene", pair.source)):
        write_scan(folder / f"{name}.ply", scan.points)
    write_pose(folder / "pose.txt", result.target_from_source)
    write_pose(folder / "exact_pose.txt", pair.target_from_source)
    names = "reference.ply, scene.ply, pose.txt, exact_pose.txt"
    try:
        require_figures()
    except MissingExtra as missing:
        return [f"wrote {names} to {folder}", f"no picture: {missing}"]
    figure = registration_figure(
        pair.target.points, pair.source.points, result, truth=pair.target_from_source
    )
    save_figure(folder / "picture.png", figure)
    return [f"wrote {names} and picture.png to {folder}"]
