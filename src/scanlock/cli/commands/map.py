"""``scanlock map``: register the scans of a folder into a trajectory and a map."""

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from scanlock.cli.mapping.drive import PAIRS, Drive, Row, read_rows
from scanlock.cli.mapping.run import MapRun, Unverified, print_lines
from scanlock.cli.method_options import MethodOptions
from scanlock.cli.option_types import CovarianceName, Flag
from scanlock.cli.run_options import Options, changed_options, digest
from scanlock.cli.scan_input import Reading
from scanlock.errors import InvalidInput, require_count, require_positive

if TYPE_CHECKING:
    from scanlock.io.sequences.scan_sequence import ScanSequence
    from scanlock.registration.methods.protocol import Method

MapFormat = Literal["ply", "pcd", "las", "laz", "npz"]

_NAMED = 8
"""Maximum number of unverified scans that are printed; the table has all."""

_OUTPUT = Group("Output folder", sort_key=2)


@Parameter(name="*", group=_OUTPUT)
@dataclass(frozen=True, kw_only=True, slots=True)
class MapOutput:
    """Options of the map and its folder."""

    voxel_size: Annotated[
        float, Parameter(help="Voxel size of the map [m]; it keeps one point per voxel.")
    ] = 0.1
    """Side of a voxel [m]."""

    map_format: Annotated[MapFormat, Parameter(help="Format of the map.")] = "ply"
    """Ending of the map."""

    overwrite: Annotated[Flag, Parameter(help="Replace the map that the folder contains.")] = False
    """Whether an existing map is replaced."""

    resume: Annotated[
        Flag, Parameter(help="Continue the map that the folder contains, after an interrupt.")
    ] = False
    """Whether an existing map is continued."""

    @property
    def map_name(self) -> str:
        """File name of the map."""
        return f"map.{self.map_format}"


def map_folder(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    how: MethodOptions | None = None,
    every: int = 1,
    scans: int | None = None,
    guess: Literal["identity", "velocity"] = "velocity",
    unverified: Unverified = "keep",
    covariance: CovarianceName = "none",
    threads: int = 1,
    verbose: Annotated[Flag, Parameter(name=["--verbose", "-v"])] = False,
    files: MapOutput | None = None,
    reading: Reading | None = None,
) -> int:
    """Register consecutive scans of a folder and build one map.

    Parameters
    ----------
    folder : Path
        Folder of scans: plain, KITTI, Ford Campus, or from scanlock simulate; or a file of
        stations, such as E57.
    output : Path
        Folder for trajectory, map and table of pairs.
    every : int
        Use every k-th scan.
    scans : int
        Maximum number of scans; all by default.
    guess : str
        Initial pose of each registration: no motion (identity), or the last motion (velocity).
    unverified : str
        Keep the pose of an unverified pair, or stop before its scan.
    covariance : str
        Estimate of the covariance of each motion, for the table of pairs.
    threads : int
        Maximum number of threads; the map does not depend on it.
    verbose : bool
        Also print the table of pairs.

    Returns
    -------
    int
        The exit code: 0 if every pair is verified, 2 if not.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_table
    from scanlock.io.sequences.open_sequence import open_sequence
    from scanlock.registration.registry import named_method

    how, files, reading = how or MethodOptions(), files or MapOutput(), reading or Reading()
    require_count("--every", every)
    require_count("--scans", 2 if scans is None else scans, 2)
    require_count("--threads", threads)
    require_positive("--voxel-size", files.voxel_size, unit="m")
    chosen = named_method(how.chosen())[1]
    sequence = open_sequence(folder, every=every, count=scans)
    if len(sequence) < 2:
        raise InvalidInput(f"{folder} must contain at least 2 scans, got {len(sequence)}")
    options = _options(chosen, how.dof, every, guess, covariance, files, reading)
    known = _known_rows(output, files, options, sequence, unverified)
    _require_format(files.map_format)
    output.mkdir(exist_ok=True)
    drive = Drive(sequence, files.voxel_size, files.map_name, options)
    keywords = {
        "method": chosen,
        "guess": guess,
        "dof": how.dof,
        "covariance": False if covariance == "none" else covariance,
    }
    run = MapRun(drive, sequence, reading, output, threads, keywords)
    with compile_watch():
        run.warm_up()
        wrote = run.finish(known, unverified)
    _show(drive, folder, sequence, files.voxel_size, run)
    if verbose:
        print_table(*drive.table())
    print_lines(wrote)
    return 2 if drive.unverified else 0


def _options(
    method: "Method[Any]",
    dof: str,
    every: int,
    guess: str,
    covariance: str,
    files: MapOutput,
    reading: Reading,
) -> Options:
    from scanlock import __version__

    return {
        "scanlock": __version__,
        "method": f"{type(method).__name__} {digest(method)}",
        "dof": dof,
        "every": every,
        "guess": guess,
        "covariance": covariance,
        "voxel_size": files.voxel_size,
        "map_format": files.map_format,
        "format": reading.format,
        "columns": reading.columns,
        "scale": reading.scale,
    }


def _known_rows(
    output: Path,
    files: MapOutput,
    options: Options,
    sequence: "ScanSequence",
    unverified: Unverified,
) -> list[Row]:
    """Return the rows of an earlier run to continue; none for a new map.

    Raises
    ------
    InvalidInput
        The folder contains a map that is neither to be continued nor to be replaced, or one with
        other options or scans.
    """
    if files.overwrite and files.resume:
        raise InvalidInput("give either --overwrite or --resume")
    has_map = any((output / name).exists() for name in (PAIRS, *output.glob("map.*")))
    if files.overwrite or not has_map:
        return []
    if not files.resume:
        raise InvalidInput(
            f"{output} contains a map already; use another folder, --resume to continue it, or "
            "--overwrite to replace it"
        )
    changes = changed_options(output, options)
    if changes is None or changes or not (output / PAIRS).exists():
        raise InvalidInput(
            f"--resume needs the options of the map in {output}: "
            f"{', '.join(changes) if changes else 'they are not known'}; use --overwrite"
        )
    rows = read_rows(output / PAIRS)
    names = sequence.names
    for row, pair in zip(rows, pairwise(names), strict=False):
        if (row["target"], row["source"]) != pair:
            raise InvalidInput(
                f"--resume needs the scans of the map in {output}: scan {row['scan']} was "
                f"{row['source']}, is {pair[1]}; use --overwrite"
            )
    rows = rows[: len(names) - 1]
    if unverified == "stop":
        good = [row["status"] == "ok" for row in rows]
        rows = rows[: good.index(False)] if False in good else rows
    return rows


def _require_format(map_format: MapFormat) -> None:
    """Raise unless a map of this format can be written, before the work."""
    import tempfile

    import numpy as np

    from scanlock.io import write_scan

    with tempfile.TemporaryDirectory() as folder:
        write_scan(Path(folder) / f"map.{map_format}", np.ones((1, 3), np.float32))


def _show(
    drive: Drive, folder: Path, sequence: "ScanSequence", voxel_size: float, run: MapRun
) -> None:
    """Print status and figures of the drive."""
    from scanlock.cli.console import print_facts, print_status
    from scanlock.cli.progress import rate_text

    of, count = len(sequence), len(drive.rows)
    print_status(
        "unverified" if drive.unverified else "ok",
        f"{count - len(drive.unverified)} of {count} pairs are verified",
        good=not drive.unverified,
    )
    facts = [("scans", f"{len(drive.poses)} of {folder} ({sequence.title})")]
    facts += [] if drive.is_on_map else [("path", f"{drive.length():.1f} m")]
    facts.append(("map", f"{len(drive.map):,} voxels of {voxel_size:g} m filled"))
    if run.registered:
        rate = rate_text(run.registered / run.seconds, "scans")
        facts.append(("time", f"{run.seconds:.1f} s without compiling, {rate}"))
    if drive.unverified:
        names = [sequence.names[index] for index in drive.unverified]
        shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
        stopped = drive.unverified[-1] == len(drive.poses)
        left = f"stopped there, {of - len(drive.poses)} of {of} scans not used"
        end = left if stopped else "all later poses depend on these"
        facts.append(("not ok", f"the motions to {shown}: {end}"))
    print_facts(facts)
