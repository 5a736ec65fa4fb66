"""Two trajectories for ``scanlock evaluate``: matched row by row, in one sensor frame."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.arrays import Labels, Vector
    from scanlock.evaluation.sensor_axes import SensorAxes
    from scanlock.geometry.pose import Pose
    from scanlock.io.sequences.trajectory import Trajectory

MatchedBy = Literal["time", "scan name", "scan number", "row"]
"""Property by which the rows of two trajectories are matched, the first that both have."""

Axes = Literal["auto", "same", "camera"]
"""Frame of the true poses: recognised, that of the estimate, or KITTI's camera."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class TrajectoryPair:
    """Matching poses of two trajectories.

    Attributes
    ----------
    estimate, truth : list of n Pose
        World from sensor.
    times : (n,) [s] or None
    matched_by : str
        See `MatchedBy`.
    counts : (int, int)
        Number of poses of both before matching.
    frame : str
        Frame of the poses as compared: "same", "camera to laser (calib.txt)" or "camera to laser
        (nominal axes)".
    notes : list of str
        Remarks on the frame.
    """

    estimate: "list[Pose]"
    truth: "list[Pose]"
    times: "Vector | None"
    matched_by: MatchedBy
    counts: tuple[int, int]
    frame: str = "same"
    notes: tuple[str, ...] = ()


def pair_trajectories(
    estimate: "Trajectory", truth: "Trajectory", first: int | None = None
) -> TrajectoryPair:
    """Match the poses of two trajectories by time, scan number or row.

    Parameters
    ----------
    estimate, truth : Trajectory
    first : int, optional
        Number of rows to compare; files without times or scan numbers are cut to it.

    Raises
    ------
    InvalidInput
        No poses match, or the numbers of poses differ without times or scan numbers.
    """
    counts = len(estimate), len(truth)
    matched_by, (here, there) = _matching_rows(estimate, truth, first)
    here, there = here[:first], there[:first]
    times = truth.times if truth.times is not None else estimate.times
    rows = there if truth.times is not None else here
    return TrajectoryPair(
        estimate=[estimate.poses[row] for row in here],
        truth=[truth.poses[row] for row in there],
        times=None if times is None else times[rows],
        matched_by=matched_by,
        counts=counts,
    )


def _matching_rows(
    estimate: "Trajectory", truth: "Trajectory", first: int | None
) -> "tuple[MatchedBy, tuple[Labels, Labels]]":
    import numpy as np

    from scanlock.evaluation.trajectory_matching import match_equal, match_times

    if estimate.times is not None and truth.times is not None:
        matched = match_times(estimate.times, truth.times)
        if len(matched[0]) == 0:
            raise InvalidInput(_no_time_in_common(estimate, truth))
        return "time", matched
    if estimate.names is not None and truth.names is not None:
        matched = match_equal(estimate.names, truth.names)
        if len(matched[0]) > 0:
            return "scan name", matched
    if estimate.numbers is not None or truth.numbers is not None:
        here, there = (
            np.arange(len(one)) if one.numbers is None else one.numbers for one in (estimate, truth)
        )
        # Rows of a file without numbers are numbered only if it has a row for each number.
        whole = here.max() < len(truth) if truth.numbers is None else there.max() < len(estimate)
        both = estimate.numbers is not None and truth.numbers is not None
        matched = match_equal(here.tolist(), there.tolist())
        if len(matched[0]) > 0 and (both or whole):
            return "scan number", matched
    counts = len(estimate), len(truth)
    rows = np.arange(min(counts) if first is None else min(first, *counts))
    if first is None and counts[0] != counts[1]:
        raise InvalidInput(
            f"{estimate.path} has {counts[0]} poses and {truth.path} {counts[1]}, without times or "
            "scan numbers to match them; use TUM format for both, or compare the first rows with "
            f"--first {len(rows)}"
        )
    return "row", (rows, rows)


def _no_time_in_common(estimate: "Trajectory", truth: "Trajectory") -> str:
    from scanlock.evaluation.trajectory_matching import MAX_TIME_DIFFERENCE

    spans = [
        f"{float(one.times.min()):.2f} to {float(one.times.max()):.2f} s"
        for one in (estimate, truth)
        if one.times is not None
    ]
    return (
        f"no time in {estimate.path} ({spans[0]}) is within {MAX_TIME_DIFFERENCE} s of one in "
        f"{truth.path} ({spans[1]}); check that both use the same clock"
    )


def in_one_frame(
    pair: TrajectoryPair, truth: "Trajectory", axes: Axes, calib: Path | None
) -> TrajectoryPair:
    """Return the pair with both trajectories in the frame of the laser.

    Parameters
    ----------
    pair : TrajectoryPair
    truth : Trajectory
        The true trajectory, with its calibration if known.
    axes : str
        See `Axes`.
    calib : Path, optional
        KITTI's calib.txt.

    Raises
    ------
    InvalidInput
        Sensor frames that differ, but not as KITTI's camera and laser.
    """
    from scanlock.evaluation.sensor_axes import compare_axes

    found = compare_axes(pair.estimate, pair.truth)
    relation = "truth_camera" if axes == "camera" else found.relation
    if relation == "same":
        return pair
    if axes == "same":
        return replace(pair, notes=(f"{_frames_differ(truth.path, found)}",))
    if relation in ("rotated", "unclear"):
        raise InvalidInput(
            f"{_frames_differ(truth.path, found)}; transform one of them, or use --axes same to "
            "compare them anyway, or --axes camera to convert from KITTI's camera frame"
        )
    which = "truth" if relation == "truth_camera" else "estimate"
    return _converted(pair, truth, calib, which)


def _frames_differ(path: Path, found: "SensorAxes") -> str:
    import math

    if found.relation == "unclear":
        return (
            f"{path} may be in KITTI's camera frame (x right, y down, z forward), but the drive "
            "turns too little to tell"
        )
    return (
        f"{path} is in another sensor frame, rotated by {math.degrees(found.angle):.0f} deg "
        "from that of the estimate, which gives wrong errors"
    )


def _converted(
    pair: TrajectoryPair,
    truth: "Trajectory",
    calib: Path | None,
    which: Literal["truth", "estimate"],
) -> TrajectoryPair:
    from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, in_other_frame
    from scanlock.io.datasets.kitti import read_kitti_calibration

    exact = truth.camera_from_laser if calib is None else read_kitti_calibration(calib)
    laser_from_camera = (exact or CAMERA_FROM_LASER).inverse()
    poses = in_other_frame(getattr(pair, which), laser_from_camera)
    subject = {"truth": "true", "estimate": "estimated"}[which]
    note = f"the {subject} poses are in KITTI's camera frame, converted to the laser's by "
    if exact is None:
        note += "nominal axes, up to 1 % of the distance uncertain; exact with --calib calib.txt"
        note += ", or with the sequence folder as the truth" if which == "truth" else ""
    else:
        note += str(calib or "calib.txt of the sequence")
    frame = f"camera to laser ({'nominal axes' if exact is None else 'calib.txt'})"
    changes = {"truth": poses} if which == "truth" else {"estimate": poses}
    return replace(pair, frame=frame, notes=(note,), **changes)
