"""Results of ``scanlock map`` so far: trajectory, table of pairs and map, and their files."""

import csv
import io
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.cli.mapping.scans import INTENSITY
from scanlock.cli.run_options import Options, write_options
from scanlock.errors import FormatError, MissingExtra

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from scanlock.clouds.point_cloud import PointCloud
    from scanlock.geometry.pose import Pose
    from scanlock.io import ScanFile
    from scanlock.io.crs.coordinate_system import CoordinateSystem
    from scanlock.io.sequences.scan_sequence import ScanSequence
    from scanlock.pipelines.odometry import OdometryStep

Row = dict[str, str]
"""A row of the table of pairs, by column."""

PAIRS = "pairs.csv"

_HEADS: tuple[str, ...] = (
    "scan",
    "target",
    "source",
    "status",
    "probability",
    "overlap",
    "score",
    "moved_m",
    "turned_deg",
    "evaluations",
    "reason",
    "target_from_source",
    "covariance",
    "milliseconds",
)
"""Columns of the table of pairs; times are last, since they differ from run to run."""

_SHOWN = ("scan", "target", "source", "status", "probability", "moved_m", "turned_deg",
          "overlap", "milliseconds")  # fmt: skip
"""Columns on the screen."""


class Drive:
    """The map, the trajectory and the table of pairs so far.

    Parameters
    ----------
    sequence : ScanSequence
    voxel_size : float [m]
    map_name : str
        File name of the map; the ending gives its format.
    options : Options
        Options of the run, to compare with those of one that continues it.

    Attributes
    ----------
    poses : list of Pose
        ``first_from_scan`` of each scan.
    positions : list of (3,) [m]
        Position of each scan in the map: that of its sensor, or the middle of its points in map
        coordinates.
    unverified : list of int
        Scans whose motion from the previous one is not verified.
    rows : list of Row
        The table of pairs.
    crs : CoordinateSystem or None
        Coordinate reference system of the scans, which the map keeps.
    """

    def __init__(
        self, sequence: "ScanSequence", voxel_size: float, map_name: str, options: Options
    ) -> None:
        from scanlock.evaluation.voxel_map import VoxelMap

        self.map = VoxelMap(voxel_size)
        self.map_name = map_name
        self.poses: list[Pose] = []
        self.positions: list[Any] = []
        self.unverified: list[int] = []
        self.rows: list[Row] = []
        self.crs: CoordinateSystem | None = None
        self._sequence = sequence
        self._origin: Any = None
        self._options = options
        self._has_options = False

    @property
    def is_on_map(self) -> bool:
        """Whether the scans have map coordinates."""
        return self._origin is not None and bool(self._origin.any())

    def add_row(self, step: "OdometryStep") -> None:
        """Add the row of a step; its scan is not added."""
        index = len(self.poses)
        if step.registration is not None:
            names = self._sequence.names
            self.rows.append(_row(index, names[index - 1], names[index], step))
        if not step.ok:
            self.unverified.append(index)

    def add_scan(
        self,
        cloud: "PointCloud",
        pose: "Pose",
        fields: "tuple[Mapping[str, NDArray[Any]], Mapping[str, NDArray[Any]]]",
    ) -> None:
        """Add a scan to the trajectory and to the map, with the fields of its points."""
        if self._origin is None:
            self._origin = cloud.origin
        # Rounded as in the file, so that the points of the file fill the voxels that are counted.
        points = (pose.apply(cloud.points + cloud.origin) - self._origin).astype("float32")
        first, means = fields
        self.map.add(points.astype("float64"), first=first, means=means)
        self.positions.append(pose.apply(cloud.origin))
        self.poses.append(pose)

    def restore(self, rows: Sequence[Row]) -> "tuple[list[Pose], Pose]":
        """Restore rows of the table; return the poses of the scans, and the last motion.

        The scans are not restored. The motion is the initial pose of the next registration with
        the guess of a constant velocity.
        """
        from scanlock.geometry.pose import Pose

        poses, motion = [Pose.identity()], Pose.identity()
        for row in rows:
            found = _pose(row["target_from_source"])
            poses.append(poses[-1] @ found)
            motion = found if row["status"] == "ok" else Pose.identity()
            if row["status"] != "ok":
                self.unverified.append(int(row["scan"]))
        self.rows = list(rows)
        return poses, motion

    def keep(self, output: Path) -> None:
        """Write poses and table so far, which then survive a kill; the map is written last."""
        from scanlock.cli.output import is_due

        if is_due(len(self.poses)):
            self._write_rows(output)

    def write(self, output: Path) -> str:
        """Write map, trajectory and table, and return the lines to print."""
        from scanlock.cli.output import write_cloud

        if not self.poses:
            return ""
        self._write_rows(output)
        write_cloud(output / self.map_name, self._cloud())
        try:
            self._draw(output / "map.png")
        except MissingExtra as missing:
            return f"wrote {self.map_name}, trajectories and {PAIRS} to {output}\n" + (
                f"no picture: {missing}"
            )
        return f"wrote {self.map_name}, map.png, trajectories and {PAIRS} to {output}"

    def _cloud(self) -> "ScanFile":
        """Return the map with its fields, in float32 unless it has map coordinates."""
        from scanlock.io import ScanFile

        points, fields = self.map.points.astype("float64"), self.map.fields
        if INTENSITY in fields:
            fields[INTENSITY] = fields[INTENSITY].astype("float32")
        return ScanFile(
            points=points + self._origin if self.is_on_map else points,
            fields=fields,
            format="npz",
            coordinate_dtype="float64" if self.is_on_map else "float32",
            crs=self.crs,
        )

    def length(self) -> float:
        """Return the length of the path [m]."""
        import numpy as np

        steps = np.diff(np.array(self.positions), axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    def table(self) -> tuple[Sequence[str], list[list[str]]]:
        """Return heads and rows of the table of pairs for the screen."""
        return _SHOWN, [[_short(name, row[name]) for name in _SHOWN] for row in self.rows]

    def _write_rows(self, output: Path) -> None:
        from scanlock.io import atomic_file, write_kitti_poses, write_tum_poses
        from scanlock.io.sequences.trajectory import SCAN_TABLE, write_scan_table

        times = self._sequence.times[: len(self.poses)]
        write_scan_table(output / SCAN_TABLE, self._sequence, len(self.poses))
        write_kitti_poses(output / "trajectory_kitti.txt", self.poses)
        write_tum_poses(output / "trajectory_tum.txt", times, self.poses)
        with atomic_file(output / PAIRS) as handle:
            table = io.StringIO()
            writer = csv.DictWriter(table, _HEADS, lineterminator="\n")
            writer.writeheader()
            writer.writerows(self.rows)
            handle.write(table.getvalue().encode())
        # Last, so that rows of this run never have the options of another.
        if not self._has_options:
            write_options(output, self._options)
            self._has_options = True

    def _draw(self, path: Path) -> None:
        import numpy as np

        from scanlock.report.canvas import require_figures, save_figure
        from scanlock.report.drive_figure import drive_figure

        require_figures()
        positions = np.array(self.positions) - self._origin
        unverified = [index for index in self.unverified if index < len(positions)]
        title = f"{len(positions)} scans, {self.length():.0f} m"
        if self.is_on_map:
            east, north, up = self._origin
            title = f"{len(positions)} scans, x, y, z from {east:.0f}, {north:.0f}, {up:.0f} m"
        points = self.map.points.astype(np.float64)
        save_figure(path, drive_figure(points, positions, unverified=unverified, title=title))


def read_rows(path: Path) -> list[Row]:
    """Read the rows of a table of pairs, up to the first incomplete one.

    Raises
    ------
    FormatError
        A table with other columns.
    """
    with path.open(newline="", encoding="utf-8") as handle:
        reader = csv.DictReader(handle)
        if tuple(reader.fieldnames or ()) != _HEADS:
            raise FormatError(
                f"{path}: expected the columns of scanlock map, found "
                f"{', '.join(reader.fieldnames or ['none'])}; map again with --overwrite"
            )
        return [{name: row[name] for name in _HEADS} for row in reader if None not in row.values()]


def _row(index: int, target: str, source: str, step: "OdometryStep") -> Row:
    from scanlock.geometry.rotations import rotation_angle

    found = step.registration
    assert found is not None
    pose, origins = found.target_from_source, found.origins
    moved = math.hypot(*origins.shift(pose, origins.reference_point))
    covariance = found.covariance
    upper = [] if covariance is None else [covariance.matrix[k, k:] for k in range(6)]
    return {
        "scan": str(index),
        "target": target,
        "source": source,
        "status": found.status.value,
        "probability": f"{found.probability:.6f}",
        "overlap": f"{found.overlap:.6f}",
        "score": f"{found.score:.6f}",
        "moved_m": f"{moved:.6f}",
        "turned_deg": f"{math.degrees(rotation_angle(pose.rotation)):.6f}",
        "evaluations": str(found.evaluations),
        "reason": found.reason,
        "target_from_source": _numbers(pose.matrix[:3].ravel()),
        "covariance": _numbers([value for values in upper for value in values]),
        "milliseconds": f"{1e3 * step.seconds:.1f}",
    }


def _numbers(values: Any) -> str:
    return " ".join(f"{float(value):.17g}" for value in values)


def _pose(text: str) -> "Pose":
    import numpy as np

    from scanlock.geometry.pose import Pose

    try:
        matrix = np.array([float(number) for number in text.split()]).reshape(3, 4)
    except ValueError as error:
        raise FormatError(
            f"{PAIRS}: target_from_source: expected 12 numbers, found {text!r}; map again with "
            "--overwrite"
        ) from error
    return Pose(matrix[:, :3], matrix[:, 3])


def _short(name: str, value: str) -> str:
    digits = {"probability": 3, "moved_m": 3, "turned_deg": 3, "overlap": 2, "milliseconds": 0}
    return f"{float(value):.{digits[name]}f}" if name in digits else value
