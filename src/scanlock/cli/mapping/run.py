"""Run of ``scanlock map``: registration of the scans of a sequence, from any of them on."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from scanlock.cli.mapping.drive import Drive, Row
from scanlock.cli.mapping.scans import MapScans
from scanlock.cli.scan_input import Reading

if TYPE_CHECKING:
    from scanlock.io.sequences.scan_sequence import ScanSequence
    from scanlock.pipelines.odometry import OdometryStep

Unverified = Literal["keep", "stop"]
"""What happens at a pair that is not verified."""


class MapRun:
    """Registration of the scans of a sequence into a drive.

    Parameters
    ----------
    drive : Drive
    sequence : ScanSequence
    reading : Reading
        Options for reading the files.
    output : Path
        Folder for the files.
    threads : int
        Maximum number of threads.
    keywords : dict
        Further arguments of `odometry`.

    Attributes
    ----------
    seconds : float [s]
        Wall time of reading, registering and adding the scans that were not known.
    registered : int
        Number of these scans.
    """

    def __init__(
        self,
        drive: Drive,
        sequence: "ScanSequence",
        reading: Reading,
        output: Path,
        threads: int,
        keywords: dict[str, Any],
    ) -> None:
        self.seconds = 0.0
        self.registered = 0
        self._drive, self._sequence, self._reading = drive, sequence, reading
        self._scans = MapScans(sequence, reading)
        self._output, self._threads, self._keywords = output, threads, keywords

    def warm_up(self) -> None:
        """Load all kernels by registering the first scan to itself, which no time includes."""
        from scanlock.cli.console import waiting
        from scanlock.pipelines.odometry import odometry

        with waiting("loading"):
            [scan] = MapScans(self._sequence, self._reading).points([0])
            list(odometry([scan, scan], **self._keywords))

    def finish(self, known: list[Row], unverified: Unverified) -> str:
        """Restore the known scans, register the rest, and write all files.

        Returns
        -------
        str
            Lines to print.
        """
        from scanlock.cli.interrupts import interrupt_delayed
        from scanlock.cli.progress import progress_counter

        drive = self._drive
        start = self._restore(known) if known else {}
        begin, done = time.perf_counter(), len(drive.poses)
        with progress_counter(len(self._sequence), "mapping", "scans", done=done) as counted:
            try:
                for step in self._steps(start):
                    with interrupt_delayed():
                        is_added = self._add(step, unverified)
                    if not is_added:
                        break
                    counted(f"{len(drive.unverified)} unverified" if drive.unverified else "")
                    drive.keep(self._output)
            except BaseException:
                # After a broken scan or an interrupt, write the map so far.
                with interrupt_delayed():
                    print_lines(self._write())
                raise
        self.seconds, self.registered = time.perf_counter() - begin, len(drive.poses) - done
        with interrupt_delayed():
            return self._write()

    def _write(self) -> str:
        self._drive.crs = self._scans.crs
        return self._drive.write(self._output)

    def _restore(self, known: list[Row]) -> dict[str, Any]:
        """Build the map of the known scans again; return the options that continue odometry."""
        from scanlock.cli.progress import progress
        from scanlock.clouds.point_cloud import PointCloud

        poses, motion = self._drive.restore(known)
        scans = self._scans.points(range(len(poses)))
        for number, points in enumerate(progress(scans, len(poses), "reading again")):
            cloud = PointCloud.from_array(points, f"scan {number}")
            self._drive.add_scan(cloud, poses[number], self._scans.fields(number, cloud))
        is_predictable = self._keywords["guess"] == "velocity" and not self._drive.is_on_map
        return {"initial_pose": poses[-1], "initial_motion": motion if is_predictable else None}

    def _steps(self, start: dict[str, Any]) -> "Iterator[OdometryStep]":
        """Return the steps after the last known scan, or all."""
        from scanlock.pipelines.odometry import odometry

        first = max(len(self._drive.poses) - 1, 0)
        scans = self._scans.points(range(first, len(self._sequence)))
        steps = odometry(scans, threads=self._threads, **start, **self._keywords)
        if start:
            # The last known scan is the target of the next one.
            self._scans.fields(first, next(steps).cloud)
        return steps

    def _add(self, step: "OdometryStep", unverified: Unverified) -> bool:
        """Add a step, and say whether its scan belongs to the trajectory."""
        drive = self._drive
        number = len(drive.poses)
        fields = self._scans.fields(number, step.cloud)
        drive.add_row(step)
        if not step.ok and unverified == "stop":
            return False
        drive.add_scan(step.cloud, step.pose, fields)
        return True


def print_lines(text: str) -> None:
    """Print lines without wrapping."""
    from scanlock.cli.console import print_line

    for line in text.splitlines():
        print_line(line)
