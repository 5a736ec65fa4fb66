"""Two scans before and after their registration: from above, and a close look at one place."""

import math
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.result import RegistrationResult
from scanlock.report.canvas import (
    ALARM,
    BLUE,
    FAINT,
    INK,
    VERMILION,
    blank_figure,
    frame,
    legend_below,
    overlay,
    richest_square,
    square_view,
    window_around,
)
from scanlock.segmentation.segmentation import segment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CLOSE_UP = 0.22
"""Side of the close-up over that of the whole view."""


def registration_figure(
    target: ArrayLike | PointCloud,
    source: ArrayLike | PointCloud,
    result: RegistrationResult,
    *,
    initial: Pose | None = None,
    truth: Pose | None = None,
) -> "Figure":
    """Return a figure of two scans as they were and as a registration leaves them.

    Points on the ground are left out of the picture: their rings say little and hide the rest.

    Parameters
    ----------
    target, source : (n, 3+) array or PointCloud [m]
        What was registered.
    result : Registration
        Where the source came to lie.
    initial : Pose, optional
        Where it started; the identity by default.
    truth : Pose, optional
        The true target_from_source, if it is known: the title then tells the error.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        A scan of the wrong shape or type, or without a finite point.
    """
    figure = blank_figure(9.0, 9.8)
    clouds = PointCloud.from_array(target, "target"), PointCloud.from_array(source, "source")
    frames = LocalOrigins.of_clouds(*clouds)
    fixed, moving = (_standing(cloud) for cloud in clouds)
    start, end = (
        frames.local(pose).apply(moving)
        for pose in (initial or Pose.identity(), result.target_from_source)
    )
    middle, half = window_around(fixed[:, :2], end[:, :2])
    side = 2.0 * half * _CLOSE_UP
    corner = richest_square([fixed, end], middle, half, side)
    figure.suptitle(
        _title(result, truth), fontsize=12, linespacing=1.5, color=INK if result.ok else ALARM
    )
    legend_below(figure, {"reference (stays)": BLUE, "scene (moves)": VERMILION})
    axes = figure.subplots(2, 2)
    for column, (name, moved) in enumerate((("before", start), ("after", end))):
        whole, close = axes[:, column]
        overlay(whole, fixed, moved, 0.6)
        square_view(whole, middle, half, ("", "y [m]"))
        whole.set_title(name, fontsize=11, color=INK)
        frame(whole, corner, side)
        overlay(close, fixed, moved, 2.5)
        square_view(close, corner + 0.5 * side, 0.5 * side, ("x [m]", "y [m]"))
        close.set_title(f"{name}, inside the frame", fontsize=9, color=FAINT)
    return figure


def _standing(cloud: PointCloud) -> Points:
    standing = cloud.points[~segment(cloud).is_ground[cloud.rows]]
    return standing if len(standing) else cloud.points


def _title(result: RegistrationResult, truth: Pose | None) -> str:
    moved, turned = result.target_from_source.distance(Pose.identity())
    facts = [f"moved {moved:.2f} m", f"turned {math.degrees(turned):.2f}°"]
    if not math.isnan(result.overlap):
        facts.append(f"overlap {100 * result.overlap:.0f} %")
    if truth is not None:
        metres, radians = result.target_from_source.distance(truth)
        facts.append(f"off by {100 * metres:.1f} cm and {math.degrees(radians):.3f}°")
    status = result.status.value.replace("_", " ")
    return f"{result.method}: {status}\n{', '.join(facts)}"
