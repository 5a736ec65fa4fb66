"""``scanlock reproduce``: reproduce an experiment of a paper."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scanlock.cli.option_types import Flag
from scanlock.cli.run_options import Options, digest, require_same_page, write_options
from scanlock.errors import InvalidInput, require_count

if TYPE_CHECKING:
    from scanlock.experiments.experiment import Experiment, Findings
    from scanlock.experiments.series import ScanSeries

ExperimentName = Literal["urban", "forest", "ladar"]

_MARKS = {True: "holds", False: "does not hold", None: "undecided"}


def reproduce(
    experiment: ExperimentName,
    /,
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    scans: int | None = None,
    seed: int = 1,
    data: Path | None = None,
    poses: Path | None = None,
    threads: int = 1,
    overwrite: Flag = False,
) -> None:
    """Reproduce an experiment of the papers and write a page with the published numbers beside.

    The same command continues an interrupted run with the same folder.

    Parameters
    ----------
    experiment : str
        The city or the forest of Das, Servos and Waslander 2013 (sections VIII-A and VIII-B), or
        the range images of Madhavan and Messina 2003 (section 3).
    output : Path
        Folder for the page, tables, figures, trajectories and maps; by default
        scanlock-EXPERIMENT.
    scans : int
        Number of scans to register, at least 2, or of positions for ladar. Claims of the paper
        are judged from ten pairs on.
    seed : int
        Seed of the simulated scans; any whole number from 0.
    data : Path
        Folder of recorded scans to use instead: KITTI, Ford Campus, or plain files.
    poses : Path
        True poses of all scans in that folder (KITTI or TUM format).
    threads : int
        Maximum number of threads of a registration; only times depend on it.
    overwrite : bool
        Replace the page of a run with other options in the folder; its registrations are used
        again.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_line, print_table, print_title, waiting
    from scanlock.cli.method_table import show_errors
    from scanlock.cli.progress import progress
    from scanlock.experiments.pairwise import SOLVED
    from scanlock.experiments.reproduce import EXPERIMENTS
    from scanlock.experiments.reproduce import reproduce as reproduced
    from scanlock.report.canvas import require_figures

    require_figures()
    require_count("--seed", seed, 0)
    require_count("--threads", threads)
    if scans is not None:
        require_count("--scans", scans, 2)
    chosen = EXPERIMENTS[experiment]
    folder = output or Path(f"scanlock-{experiment}")
    with compile_watch():
        with waiting("preparing"):
            series = _series(chosen, scans, seed, data, poses)
        options = _options(chosen, series)
        if not overwrite:
            require_same_page(folder, options, "reproduction")
        folder.mkdir(exist_ok=True)
        done = reproduced(chosen, series, folder, progress, threads=threads)
    write_options(folder, options)
    print_title(f"{chosen.title}: {series.title}")
    headline = done.findings.headline
    if headline is not None:
        print_table(headline.heads, headline.texts())
    else:
        voxels = {name: len(points) for name, points in done.findings.maps.items()}
        show_errors(done.outcome.records, SOLVED, voxels=voxels)
    _show_claims(done.findings)
    print_line(f"wrote {done.page} with tables, figures and maps")


def _options(experiment: "Experiment", series: "ScanSeries") -> Options:
    """Return what makes a run another one."""
    points = digest(series.key, *series.names, *series.truth)
    settings = {one.name: one.method for one in experiment.contenders}
    return {
        "experiment": experiment.name,
        "scans": f"{series.origin or series.title} ({points})",
        "settings": digest(*settings, *settings.values(), experiment.starts),
    }


def _series(
    experiment: "Experiment", scans: int | None, seed: int, data: Path | None, poses: Path | None
) -> "ScanSeries":
    from scanlock.experiments.series import recorded_series

    if data is not None:
        if experiment.every is None:
            raise InvalidInput(
                f"--data {data} cannot be used: {experiment.name} needs range images, which are "
                "simulated; omit --data"
            )
        return recorded_series(data, every=experiment.every, scans=scans, poses=poses)
    if poses is not None:
        raise InvalidInput("--poses needs --data; simulated scans have exact poses")
    return experiment.simulate(scans or experiment.scans, seed)


def _show_claims(findings: "Findings") -> None:
    from scanlock.cli.console import Facts, print_facts, print_title

    facts: Facts = [
        (_MARKS[claim.holds], f"{claim.statement} ({claim.reason})")
        for section in findings.sections
        for claim in section.claims
    ]
    if facts:
        print_title("conclusions of the paper, and whether they hold here")
        print_facts(facts)
