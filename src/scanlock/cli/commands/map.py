"""``scanlock map``: register the scans of a folder into a trajectory and a map."""

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
    from scanlock.pipelines.odometry import OdometryStep
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
"""Maximum number of unverified scans that are printed; the table has all."""


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
    unverified: Literal["keep", "stop"] = "keep",
    voxel_size: float = 0.1,
) -> int:
    """Register consecutive scans of a folder and build one map.

    Parameters
    ----------
    folder : Path
        Folder of scans: plain, KITTI, Ford Campus, or from scanlock simulate.
    output : Path
        Folder for trajectory, map and table of pairs; it must not contain a map yet.
    method : str
        Registration method; auto by default.
    settings : Path
        A method with your own settings: TOML as printed by scanlock settings.
    dof : str
        Degrees of freedom to estimate: all, or fewer for levelled scanners (xyz+yaw) and planar
        motion (xy+yaw).
    every : int
        Use every k-th scan.
    scans : int
        Maximum number of scans; all by default.
    guess : str
        Initial pose of each registration: no motion (identity), or the last motion (velocity).
    unverified : str
        Keep the pose of an unverified pair, or stop before its scan.
    voxel_size : float
        Voxel size of the map [m]; it keeps one point per voxel.

    Returns
    -------
    int
        The exit code: 0 if every pair is verified, 2 if not.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import counting
    from scanlock.cli.interrupts import interrupt_delayed
    from scanlock.cli.method_option import chosen_method
    from scanlock.io.sequences import open_sequence
    from scanlock.pipelines.odometry import odometry

    require_count("--every", every)
    require_count("--scans", 2 if scans is None else scans, 2)
    require_positive("--voxel-size", voxel_size, unit="m")
    if (output / "map.ply").exists():
        raise InvalidInput(f"{output} contains a map already; use another folder, or remove it")
    chosen = chosen_method(method, settings)
    sequence = open_sequence(folder, every=every, count=scans)
    if len(sequence) < 2:
        raise InvalidInput(f"{folder} must contain at least 2 scans, got {len(sequence)}")
    output.mkdir(parents=True, exist_ok=True)
    drive = _Drive(sequence, voxel_size)
    with compile_watch():
        steps = odometry(
            (sequence.scan(index) for index in counting(range(len(sequence)), "scans")),
            method=chosen,
            guess=guess,
            dof=dof,
        )
        try:
            for step in steps:
                with interrupt_delayed():
                    outcome = drive.add(step, unverified)
                if outcome == "stopped":
                    break
                drive.keep(output)
        except BaseException:
            # After a broken scan or an interrupt, write the map so far.
            with interrupt_delayed():
                _print_lines(drive.write(output))
            raise
    with interrupt_delayed():
        wrote = drive.write(output)
    drive.show(folder)
    _print_lines(wrote)
    return 2 if drive.unverified else 0


class _Drive:
    """The map, the trajectory and the table of pairs so far.

    Attributes
    ----------
    unverified : list of int
        Scans whose motion from the previous one is not verified.
    """

    def __init__(self, sequence: "ScanSequence", voxel_size: float) -> None:
        from scanlock.evaluation.voxel_map import VoxelMap

        self.unverified: list[int] = []
        self._sequence = sequence
        self._voxel_size = voxel_size
        self._map = VoxelMap(voxel_size)
        self._poses: list[Pose] = []
        self._rows: list[tuple[str | int, ...]] = []

    def add(
        self, step: "OdometryStep", unverified: Literal["keep", "stop"]
    ) -> Literal["added", "stopped"]:
        """Add a scan to the map, unless it is not verified and `unverified` is "stop"."""
        index = len(self._poses)
        if step.registration is not None:
            names = self._sequence.names
            self._rows.append(_row(index, names[index - 1], names[index], step.registration))
        if not step.ok:
            self.unverified.append(index)
            if unverified == "stop":
                return "stopped"
        # Rounded as in the file, so that the points of the file fill the voxels that are counted.
        points = step.pose.apply(step.cloud.points + step.cloud.origin).astype("float32")
        self._map.add(points.astype("float64"))
        self._poses.append(step.pose)
        return "added"

    def keep(self, output: Path) -> None:
        """Write poses and table so far, which then survive a kill; the map is written last."""
        from scanlock.cli.output import is_due

        if is_due(len(self._poses)):
            self._write_rows(output)

    def write(self, output: Path) -> str:
        """Write map, trajectory and table, and return the line to print."""
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
        """Print status and figures of the drive."""
        from scanlock.cli.console import print_facts, print_status

        of = len(self._sequence)
        count = len(self._rows)
        print_status(
            "unverified" if self.unverified else "ok",
            f"{count - len(self.unverified)} of {count} pairs are verified",
            good=not self.unverified,
        )
        facts = [
            ("scans", f"{len(self._poses)} of {folder} ({self._sequence.title})"),
            ("path", f"{self._length():.1f} m"),
            ("map", f"{len(self._map):,} voxels of {self._voxel_size:g} m filled"),
        ]
        if self.unverified:
            names = [self._sequence.names[index] for index in self.unverified]
            shown = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
            stopped = self.unverified[-1] == len(self._poses)
            left = f"stopped there, {of - len(self._poses)} of {of} scans not used"
            end = left if stopped else "all later poses depend on these"
            facts.append(("not ok", f"the motions to {shown}: {end}"))
        print_facts(facts)

    def _write_rows(self, output: Path) -> None:
        from scanlock.io import atomic_file, write_kitti_poses, write_tum_poses
        from scanlock.io.trajectories import SCAN_TABLE, write_scan_table

        times = self._sequence.times[: len(self._poses)]
        write_scan_table(output / SCAN_TABLE, self._sequence, len(self._poses))
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
        positions = np.array([pose.translation for pose in self._poses])
        untrusted = [index for index in self.unverified if index < len(positions)]
        title = f"{len(positions)} scans, {self._length():.0f} m"
        points = self._map.points.astype(np.float64)
        save_figure(path, drive_figure(points, positions, untrusted=untrusted, title=title))

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
        found.evaluations,
        found.reason,
    )


def _print_lines(text: str) -> None:
    from scanlock.cli.console import print_line

    for line in text.splitlines():
        print_line(line)
