"""``scanlock simulate``: simulate a folder of scans with exact poses and labels."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scanlock.cli.option_types import FormatName, ScannerName, SceneName
from scanlock.errors import InvalidInput, require_count

if TYPE_CHECKING:
    from scanlock.geometry.pose import Pose
    from scanlock.io.scan_file import Field
    from scanlock.simulation import LadarSequence, SimulatedScan, SimulatedSequence

MotionName = Literal["removed", "kept"]

_CONVENTIONS = {
    "scans": "points in the frame of the sensor [m]: x ahead, y left, z up; those of facet-ladar "
    "in the frame of its vehicle",
    "poses": "world_from_sensor in the middle of each sweep; of facet-ladar, world_from_vehicle; "
    "one line a scan",
    "poses_kitti.txt": "rows of the 3x4 matrix",
    "poses_tum.txt": "t x y z qx qy qz qw, seconds and metres",
    "labels": "one class for each point of the scan with the same number",
}


def simulate(
    scene: SceneName,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    sensor: ScannerName = "hdl-64e",
    scans: int = 10,
    every: int = 1,
    seed: int = 1,
    format: FormatName = "bin",
    motion: MotionName = "removed",
) -> None:
    """Simulate scans along a drive through a scene, with exact poses and labels.

    Parameters
    ----------
    scene : str
        The scene: a street by car, a forest by a slow robot, or rugged off-road terrain.
    output : Path
        Folder for the scans; it must not contain scans yet.
    sensor : str
        A lidar that sweeps rows of beams, or the forward-looking facet ladar.
    scans : int
        Number of scans.
    every : int
        Keep every k-th sweep of the drive, at 10 Hz.
    seed : int
        Seed of scene, drive and noise; any whole number from 0.
    format : str
        Format of the scans.
    motion : str
        Motion distortion of a sweep: removed or kept.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import counting, print_line, waiting
    from scanlock.cli.interrupts import interrupt_delayed
    from scanlock.io import FORMATS

    for name, count, least in (("--scans", scans, 1), ("--every", every, 1), ("--seed", seed, 0)):
        require_count(name, count, least)
    folder = _Folder(output, FORMATS[format].extensions[0], motion)
    folder.prepare()
    with compile_watch():
        with waiting(f"building the {scene}"):
            sequence = _sequence(scene, sensor, 1 + (scans - 1) * every, seed)
        try:
            for index in counting(range(0, len(sequence), every), "scans"):
                scan = sequence[index]
                with interrupt_delayed():
                    folder.add(scan)
        finally:
            # After an interrupt there are as many poses as scans.
            with interrupt_delayed():
                folder.write_poses()
    folder.write_settings(
        {
            "scene": scene,
            "sensor": sensor,
            "scans": scans,
            "every": every,
            "seed": seed,
            "format": format,
            "motion": motion,
        }
    )
    print_line(f"wrote {scans} scans ({folder.points:,} points) with labels and poses to {output}")


def _sequence(
    scene: str, sensor: str, count: int, seed: int
) -> "SimulatedSequence | LadarSequence":
    from scanlock.simulation import (
        SENSORS,
        FacetLadar,
        LadarSequence,
        PanTiltMount,
        SimulatedSequence,
        drive_through,
    )

    place, drive = drive_through(scene, count=count, seed=seed)
    if sensor == "facet-ladar":
        return LadarSequence(
            world=place.world, ladar=FacetLadar(), mount=PanTiltMount(), drive=drive, seed=seed
        )
    spinning = SENSORS[sensor.replace("-", "_")]()
    return SimulatedSequence(world=place.world, sensor=spinning, drive=drive, seed=seed)


class _Folder:
    """The folder that scans, labels and poses go into.

    Attributes
    ----------
    points : int
        Number of points of the scans so far.
    """

    def __init__(self, path: Path, extension: str, motion: MotionName) -> None:
        self.points = 0
        self._path = path
        self._extension = extension
        self._motion = motion
        self._times: list[float] = []
        self._poses: list[Pose] = []

    def prepare(self) -> None:
        """Create the folder; refuse one that contains scans."""
        scans = self._path / "scans"
        if scans.exists() and any(scans.iterdir()):
            raise InvalidInput(f"{scans} contains scans already; use another folder, or remove it")
        from scanlock.cli.output import require_folder

        require_folder(self._path)
        self._path.mkdir(exist_ok=True)
        scans.mkdir(exist_ok=True)
        (self._path / "labels").mkdir(exist_ok=True)

    def add(self, scan: "SimulatedScan") -> None:
        """Write one scan, its labels and the poses so far, which then survive a kill."""
        from scanlock.cli.output import is_due
        from scanlock.io import write_labels, write_scan

        name = f"{len(self._poses):06d}"
        points = scan.points if self._motion == "kept" else scan.deskewed()
        write_scan(self._path / "scans" / f"{name}{self._extension}", points, self._fields(scan))
        write_labels(self._path / "labels" / f"{name}.npy", scan.labels)
        self.points += len(scan)
        self._times.append(scan.time)
        self._poses.append(scan.pose)
        if is_due(len(self._poses)):
            self.write_poses()

    def write_poses(self) -> None:
        """Write the poses of the scans so far, if any."""
        from scanlock.io import write_kitti_poses, write_tum_poses

        if self._poses:
            write_kitti_poses(self._path / "poses_kitti.txt", self._poses)
            write_tum_poses(self._path / "poses_tum.txt", self._times, self._poses)

    def write_settings(self, settings: Mapping[str, Any]) -> None:
        """Write the settings of the simulation and the conventions of the files."""
        from scanlock import __version__
        from scanlock.io import atomic_file
        from scanlock.simulation import SurfaceClass

        content = {
            "scanlock": __version__,
            "settings": settings,
            "conventions": _CONVENTIONS,
            "classes": {kind.name.lower(): int(kind) for kind in SurfaceClass},
        }
        with atomic_file(self._path / "settings.json") as handle:
            handle.write((json.dumps(content, indent=2) + "\n").encode())

    def _fields(self, scan: "SimulatedScan") -> dict[str, "Field"]:
        import numpy as np

        if self._extension == ".bin":
            # KITTI readers expect rows of four numbers.
            return {"intensity": np.zeros(len(scan), np.float32)}
        if self._extension == ".npy":
            return {}
        return {"ring": scan.rings.astype(np.uint16), "time": scan.times}
