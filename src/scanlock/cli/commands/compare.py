"""``scanlock compare``: compare methods on pairs of scans."""

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Group, Parameter

from scanlock.cli.method_options import CHANGES, Changes
from scanlock.cli.option_types import Flag, MethodName
from scanlock.cli.run_options import Options, digest, require_same_page, write_options
from scanlock.cli.scan_input import Reading
from scanlock.errors import InvalidInput, require_count

if TYPE_CHECKING:
    from collections.abc import Sequence

    from scanlock.experiments.comparison import Comparison
    from scanlock.experiments.series import ScanSeries
    from scanlock.pipelines.starts import AroundTruth
    from scanlock.pipelines.study import StudyPair
    from scanlock.registration.methods.protocol import Method

_TRUTH = Group("Ground truth", sort_key=2)
_STARTS = Group("Initial poses around the true pose", sort_key=3)

_SEVERAL = Parameter(consume_multiple=True, negative="")
"""An option that takes several values."""

_Numbers = Annotated[tuple[float, ...], _SEVERAL]

_DISTANCES, _ANGLES = (0.0, 1.0, 2.0, 4.0, 8.0), (0.0, 10.0, 20.0, 40.0)


@Parameter(name="*", group=_TRUTH)
@dataclass(frozen=True, kw_only=True, slots=True)
class Truth:
    """Source of the true poses."""

    poses: Annotated[
        Path | None, Parameter(help="world_from_sensor of every scan, KITTI or TUM format.")
    ] = None
    """Trajectory file, in place of the folder's own poses."""

    truth: Annotated[
        Path | None, Parameter(help="Pose of the second of two scans in the first (4x4 matrix).")
    ] = None
    """Pose file."""

    agree: Annotated[
        Flag,
        Parameter(help="Use the pose that most methods agree on where there is no other."),
    ] = False
    """Whether agreement counts as truth."""

    metres: Annotated[
        float, Parameter(help="Translation error below which a pair is solved [m].")
    ] = 0.3
    """Translation limit [m]."""

    degrees: Annotated[
        float, Parameter(help="Rotation error below which a pair is solved [deg].")
    ] = 1.0
    """Rotation limit [deg]."""


@Parameter(name="*", group=_STARTS)
@dataclass(frozen=True, kw_only=True, slots=True)
class Starts:
    """Errors of the initial poses that measure the basin of convergence."""

    starts: Annotated[
        int | None,
        Parameter(
            help="Initial poses per pair of errors; by default 1 with ground truth or with "
            "--distances or --angles, else 0."
        ),
    ] = None
    """Repeats of every cell."""

    distances: Annotated[
        _Numbers | None, Parameter(help="Errors of translation [m]; 0 1 2 4 8 by default.")
    ] = None
    """Rows of the basin [m]."""

    angles: Annotated[
        _Numbers | None, Parameter(help="Errors of rotation [deg]; 0 10 20 40 by default.")
    ] = None
    """Columns of the basin [deg]."""

    axis: Annotated[
        Literal["vertical", "random"], Parameter(help="Axis of the rotation errors.")
    ] = "vertical"
    """Axis of the rotation errors."""

    seed: Annotated[int, Parameter(help="Seed of the directions of the errors.")] = 0
    """Any whole number from 0."""

    def plan(self, *, has_truth: bool, agree: bool) -> "AroundTruth | None":
        """Return the starts, or None for none."""
        from scanlock.pipelines.starts import AroundTruth

        is_asked = self.distances is not None or self.angles is not None
        repeats = self.starts if self.starts is not None else int(has_truth or (is_asked and agree))
        require_count("--starts", repeats, 0)
        if repeats and not (has_truth or agree):
            raise InvalidInput("--starts needs true poses; give --poses, --truth or --agree")
        if not repeats:
            return None
        return AroundTruth(
            distances=_DISTANCES if self.distances is None else self.distances,
            angles=tuple(math.radians(angle) for angle in self.angles or _ANGLES),
            repeats=repeats,
            axis=self.axis,
            seed=self.seed,
        )


def compare(
    *scans: Path,
    methods: Annotated[tuple[MethodName, ...] | None, _SEVERAL] = None,
    settings: Annotated[tuple[Path, ...], _SEVERAL, Parameter(show_default=False)] = (),
    changes: Changes = (),
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("scanlock-compare"),
    every: int = 1,
    step: int = 1,
    pairs: int | None = None,
    threads: int = 1,
    overwrite: Flag = False,
    truth: Truth | None = None,
    starts: Starts | None = None,
    reading: Reading | None = None,
) -> None:
    """Compare methods on pairs of scans: errors, times and basins of convergence.

    The same command continues an interrupted run with the same folder.

    Parameters
    ----------
    scans : Path
        Two scan files or more, one folder of scans, or a file of stations. Each scan is the
        source, the one before it the target.
    methods : str
        Registration methods; all by default.
    settings : Path
        More methods with your own settings: TOML as printed by scanlock settings.
    output : Path
        Folder for tables, pictures and records.
    every : int
        Use every k-th scan of the folder.
    step : int
        Number of scans between source and target.
    pairs : int
        Maximum number of pairs, evenly spread.
    threads : int
        Maximum number of threads of a registration; only times depend on it.
    overwrite : bool
        Replace the page of another comparison in the folder; its registrations are used again.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_line, print_title
    from scanlock.cli.method_table import show_basins, show_errors
    from scanlock.cli.progress import progress
    from scanlock.experiments.comparison import Comparison, comparison_findings
    from scanlock.experiments.comparison import compare as compared_by
    from scanlock.experiments.page import series_text, truth_sentence, write_findings
    from scanlock.experiments.pairwise import Tolerance
    from scanlock.report.canvas import require_figures

    require_figures()
    for name, count in (("--every", every), ("--step", step), ("--pairs", pairs)):
        require_count(name, 1 if count is None else count)
    require_count("--threads", threads)
    ground_truth, initial = truth or Truth(), starts or Starts()
    series = _series(scans, every, ground_truth, reading or Reading())
    chosen = _chosen(series, step, pairs, ground_truth)
    has_truth = any(pair.truth is not None for pair in chosen)
    comparison = Comparison(
        methods=_methods(methods, settings, changes),
        pairs=chosen,
        load=series.load,
        key=series.key,
        around=initial.plan(has_truth=has_truth, agree=ground_truth.agree),
        use_consensus=ground_truth.agree,
        tolerance=Tolerance(metres=ground_truth.metres, degrees=ground_truth.degrees),
        threads=threads,
    )
    options = _options(comparison)
    if not overwrite:
        require_same_page(output, options, "comparison")
    output.mkdir(exist_ok=True)
    with compile_watch():
        done = compared_by(comparison, output / "records.jsonl", progress)
    count = f"{len(chosen)} pair{'s' if len(chosen) > 1 else ''}"
    print_title(f"{series.title}: {count}")
    show_errors(done.direct, comparison.tolerance)
    if done.consensus_count:
        print_line("errors: differences from the pose that most other methods agree on")
    elif not done.evaluated_count:
        print_line("errors: no true poses; give --poses, --truth or --agree")
    if comparison.around is not None:
        show_basins(done, comparison.around, comparison.tolerance)
    findings = comparison_findings(comparison, done, series)
    intro = f"{series_text(series)}, {count}. {truth_sentence(series)}"
    page = write_findings(output, "Comparison of methods", intro, comparison.methods, findings)
    write_options(output, options)
    print_line(f"wrote {page} with tables, pictures and records")


def _options(comparison: "Comparison") -> Options:
    pairs, plan = comparison.pairs, comparison.around
    return {
        "scans": digest(comparison.key, *pairs),
        "pairs": len(pairs),
        "methods": " ".join(comparison.methods),
        "settings": digest(*comparison.methods.values()),
        "agree": comparison.use_consensus,
        "starts": "none" if plan is None else f"{len(plan.names)}, {digest(plan)}",
        "solved": str(comparison.tolerance),
    }


def _methods(
    names: "Sequence[MethodName] | None", settings: "Sequence[Path]", changes: "Sequence[str]"
) -> "dict[str, Method[Any]]":
    from scanlock.registration.registry import METHODS, named_method
    from scanlock.registration.settings.changes import changed_settings
    from scanlock.registration.settings.file import read_settings

    found: dict[str, Method[Any]] = dict(map(named_method, names or METHODS))
    for path in settings:
        if path.stem in found:
            raise InvalidInput(f"two methods have the name {path.stem}; rename {path.name}")
        found[path.stem] = read_settings(path)
    if not changes:
        return found
    return {
        name: changed_settings(method, changes, f"{CHANGES} for {name}")
        for name, method in found.items()
    }


def _series(
    scans: "Sequence[Path]", every: int, ground_truth: Truth, reading: Reading
) -> "ScanSeries":
    import numpy as np

    from scanlock.experiments.series import recorded_series, series_of
    from scanlock.io.poses.trajectory_files import read_trajectory
    from scanlock.io.sequences.scan_sequence import ScanSequence
    from scanlock.io.station_files import station_paths

    if len(scans) == 1 and (scans[0].is_dir() or len(station_paths(scans[0])) > 1):
        return recorded_series(scans[0], every=every, poses=ground_truth.poses)
    if len(scans) < 2:
        raise InvalidInput("name two scan files or more, or one folder or file of scans")
    poses = () if ground_truth.poses is None else tuple(read_trajectory(ground_truth.poses)[1])
    if len(poses) not in (0, len(scans)):
        raise InvalidInput(
            f"--poses must hold one for each of {len(scans)} scans, got {len(poses)}"
        )
    files = ScanSequence(
        title="scan files",
        paths=tuple(scans),
        times=np.arange(len(scans), dtype=np.float64),
        poses=poses,
        load=lambda path: reading.load(path).returns,
    )
    names = " ".join(path.name for path in scans)
    variant = f"{reading.format} {reading.columns} {reading.scale}"
    return series_of(files, title=f"{len(scans)} scan files", origin=names, variant=variant)


def _chosen(
    series: "ScanSeries", step: int, max_pairs: int | None, ground_truth: Truth
) -> "list[StudyPair]":
    from scanlock.io import read_pose

    pairs = series.pairs(step)
    if ground_truth.truth is not None:
        if len(pairs) != 1 or ground_truth.poses is not None:
            raise InvalidInput("--truth is the pose of one pair; give --poses for more scans")
        return [replace(pairs[0], truth=read_pose(ground_truth.truth))]
    if max_pairs is None or max_pairs >= len(pairs):
        return pairs
    return [pairs[row * len(pairs) // max_pairs] for row in range(max_pairs)]
