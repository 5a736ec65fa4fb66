"""``scanlock map``: a folder of scans to a trajectory and a map."""

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scanlock.cli.option_types import DofName, MethodName
from scanlock.errors import InvalidInput, MissingExtra, require_count, require_positive

if TYPE_CHECKING:
    from scanlock.geometry.pose import Pose
    from scanlock.io.sequences import ScanSequence
    from scanlock.pipelines.mapping import MappedScan
    from scanlock.registration.result import RegistrationResult

_HEADS = (
    "scan",
    "target",
    "source",
    "status",
    "overlap",
    "score",
    "moved_m",
    "turned_deg",
    "evaluations",
    "reason",
)
_NAMED = 8
"""How many doubtful scans are named on the screen; the table has all."""


def map_folder(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    method: MethodName | None = None,
    settings: Path | None = None,
    dof: DofName = "xyz+rpy",
    every: int = 1,
    scans: int | None = None,
    guess: Literal["identity", "velocity"] = "velocity",
    doubt: Literal["keep", "stop"] = "keep",
    width: float = 0.1,
) -> int:
    """Register each scan to the one before, and lay all of them into one map.

    Parameters
    ----------
    folder : Path
        A folder of scans: plain, KITTI, Ford Campus, or of scanlock simulate.
    output : Path
        Folder for the trajectory, the map and the table of pairs; it must not hold a map yet.
    method : str
        How to register; auto by default.
    settings : Path
        A method with settings of your own: TOML as scanlock settings prints it.
    dof : str
        What may change from where a registration begins: everything, or less for levelled
        scanners (xyz+yaw) and a flat world (xy+yaw).
    every : int
        Take every k-th scan.
    scans : int
        Take so many at most; all by default.
    guess : str
        Where registrations begin: at no motion, or at the last one.
    doubt : str
        Keep the best pose of a pair that is not to be trusted, or stop before its scan.
    width : float
        The map keeps one point in each voxel of this side [m].

    Returns
    -------
    int
        The exit code: 0 if every pair is to be trusted, 2 if not.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import counting
    from scanlock.cli.interrupts import undisturbed
    from scanlock.cli.method_option import chosen_method
    from scanlock.io.sequences import open_sequence
    from scanlock.pipelines.mapping import mapped_scans

    require_count("--every", every)
    require_count("--scans", 2 if scans is None else scans, 2)
    require_positive("--width", width, unit="m")
    if (output / "map.ply").exists():
        raise InvalidInput(f"{output} holds a map already; name another folder, or remove it")
    chosen = chosen_method(method, settings)
    sequence = open_sequence(folder, every=every, count=scans)
    if len(sequence) < 2:
        raise InvalidInput(f"{folder} must give at least 2 scans to map, got {len(sequence)}")
    output.mkdir(parents=True, exist_ok=True)
    drive = _Drive(sequence, width)
    with compile_watch():
        steps = mapped_scans(
            (sequence.scan(index) for index in counting(range(len(sequence)), "scans")),
            method=chosen,
            guess=guess,
            dof=dof,
        )
        try:
            for step in steps:
                with undisturbed():
                    added = drive.add(step, doubt)
                if added == "stopped":
                    break
                drive.keep(output)
        except BaseException:
            # A broken scan or an interrupt after hours leaves the map up to there.
            with undisturbed():
                _say(drive.write(output))
            raise
    with undisturbed():
        wrote = drive.write(output)
    drive.show(folder)
    _say(wrote)
    return 2 if drive.doubtful else 0


class _Drive:
    """The map, the trajectory and the table, as far as they have come.

    Attributes
    ----------
    doubtful : list of int
        Scans whose motion from the one before is not to be trusted.
    """

    def __init__(self, sequence: "ScanSequence", width: float) -> None:
        from scanlock.evaluation.voxel_map import VoxelMap

        self.doubtful: list[int] = []
        self._sequence = sequence
        self._width = width
        self._map = VoxelMap(width)
        self._poses: list[Pose] = []
        self._rows: list[tuple[str | int, ...]] = []

    def add(self, step: "MappedScan", doubt: Literal["keep", "stop"]) -> Literal["laid", "stopped"]:
        """Lay a scan into the map, unless its motion is in doubt and that is to end the drive."""
        index = len(self._poses)
        if step.registration is not None:
            names = self._sequence.names
            self._rows.append(_row(index, names[index - 1], names[index], step.registration))
        if not step.ok:
            self.doubtful.append(index)
            if doubt == "stop":
                return "stopped"
        # Rounded as the file has them, so that its points fill as many voxels as are counted.
        laid = step.pose.apply(step.cloud.points + step.cloud.origin).astype("float32")
        self._map.add(laid.astype("float64"))
        self._poses.append(step.pose)
        return "laid"

    def keep(self, output: Path) -> None:
        """Write the poses and the table so far, which outlast even a kill; the map comes last."""
        from scanlock.cli.output import is_worth_keeping

        if is_worth_keeping(len(self._poses)):
            self._write_rows(output)

    def write(self, output: Path) -> str:
        """Write what there is, and return what to say of it."""
        from scanlock.io import write_scan

        if not self._poses:
            return ""
        self._write_rows(output)
        write_scan(output / "map.ply", self._map.points)
        try:
            self._draw(output / "map.png")
        except MissingExtra as missing:
            return f"wrote map.ply, trajectories and pairs.csv to {output}\nno picture: {missing}"
        return f"wrote map.ply, map.png, trajectories and pairs.csv to {output}"

    def show(self, folder: Path) -> None:
        """Print the verdict and the figures of the drive."""
        from scanlock.cli.console import print_facts, print_status

        of = len(self._sequence)
        count = len(self._rows)
        print_status(
            "doubtful" if self.doubtful else "ok",
            f"{count - len(self.doubtful)} of {count} pairs are to be trusted",
            good=not self.doubtful,
        )
        facts = [
            ("scans", f"{len(self._poses)} of {folder} ({self._sequence.title})"),
            ("path", f"{self._length():.1f} m"),
            ("map", f"{len(self._map):,} voxels of {self._width:g} m filled"),
        ]
        if self.doubtful:
            names = [self._sequence.names[index] for index in self.doubtful]
            shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
            stopped = self.doubtful[-1] == len(self._poses)
            left = f"stopped there, {of - len(self._poses)} of {of} scans left out"
            end = left if stopped else "all after them stands on these"
            facts.append(("not ok", f"the motions to {shown}: {end}"))
        print_facts(facts)

    def _write_rows(self, output: Path) -> None:
        from scanlock.io import atomic_file, write_kitti_poses, write_tum_poses

        times = self._sequence.times[: len(self._poses)]
        write_kitti_poses(output / "trajectory_kitti.txt", self._poses)
        write_tum_poses(output / "trajectory_tum.txt", times, self._poses)
        with atomic_file(output / "pairs.csv") as handle:
            table = io.StringIO()
            csv.writer(table, lineterminator="\n").writerows([_HEADS, *self._rows])
            handle.write(table.getvalue().encode())

    def _draw(self, path: Path) -> None:
        import numpy as np

        from scanlock.report.canvas import require_figures, save_figure
        from scanlock.report.drive_figure import drive_figure

        require_figures()
        places = np.array([pose.translation for pose in self._poses])
        kept = [index for index in self.doubtful if index < len(places)]
        title = f"{len(places)} scans, {self._length():.0f} m"
        points = self._map.points.astype(np.float64)
        save_figure(path, drive_figure(points, places, untrusted=kept, title=title))

    def _length(self) -> float:
        from scanlock.evaluation.trajectory_errors import path_lengths

        return float(path_lengths(self._poses)[-1])


def _row(
    index: int, target: str, source: str, found: "RegistrationResult"
) -> tuple[str | int, ...]:
    from scanlock.geometry.pose import Pose

    metres, radians = found.target_from_source.distance(Pose.identity())
    return (
        index,
        target,
        source,
        found.status.value,
        f"{found.overlap:.6f}",
        f"{found.score:.6f}",
        f"{metres:.6f}",
        f"{math.degrees(radians):.6f}",
        found.iterations,
        found.reason,
    )


def _say(text: str) -> None:
    from scanlock.cli.console import print_line

    for line in text.splitlines():
        print_line(line)
