"""Figure of two scans before and after registration, from above and as a close-up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from scanlock.arrays import Points
from scanlock.clouds.coordinates import HasPoints
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.result import RegistrationResult
from scanlock.report.canvas import (
    ALARM,
    BLUE,
    FAINT,
    INK,
    VERMILION,
    blank_figure,
    close_up_corner,
    draw_frame,
    legend_below,
    overlay,
    set_map_view,
    window_around,
)
from scanlock.segmentation.segmentation import segment

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_CLOSE_UP = 0.22
"""Ratio of the side of the close-up to that of the whole view."""

_MIDDLE = 94.0
"""Percentile of the coordinates at which a view without close-up ends."""


def registration_figure(
    result: RegistrationResult,
    *,
    source: ArrayLike | HasPoints | PointCloud,
    target: ArrayLike | HasPoints | PointCloud,
    initial: Pose | None = None,
    truth: Pose | None = None,
    close_up: bool = True,
) -> Figure:
    """Return a figure of two scans from above, before and after registration.

    Ground points are omitted, because their rings cover the other points.

    Parameters
    ----------
    result : RegistrationResult
        Result of the registration.
    source, target : (n, 3+) array, object with points, or PointCloud [m]
        Registered scans.
    initial : Pose, optional
        Initial pose of the source; the identity by default.
    truth : Pose, optional
        True target_from_source; adds the error to the title.
    close_up : bool
        Whether to add a row of close-ups. Without it the view is limited to the middle of the
        scans.

    Returns
    -------
    matplotlib.figure.Figure
        A notebook shows it; ``figure.savefig("pair.png")`` saves it.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        A scan has the wrong shape or type, or no finite point.
    """
    figure = blank_figure(9.0, 9.8 if close_up else 5.4)
    clouds = PointCloud.from_array(target, "target"), PointCloud.from_array(source, "source")
    origins = LocalOrigins.of_clouds(*clouds)
    target_points, source_points = (_obstacles(cloud) for cloud in clouds)
    start, end = (
        origins.local(pose).apply(source_points)
        for pose in (initial or Pose.identity(), result.target_from_source)
    )
    centre, half = window_around(
        target_points[:, :2], end[:, :2], percentile=97.0 if close_up else _MIDDLE
    )
    figure.suptitle(
        _title(result, truth), fontsize=12, linespacing=1.5, color=INK if result.ok else ALARM
    )
    legend_below(figure, {"target": BLUE, "source": VERMILION})
    axes = figure.subplots(2 if close_up else 1, 2, squeeze=False)
    for view, name, points in zip(axes[0], ("before", "after"), (start, end), strict=True):
        overlay(view, target_points, points, 0.6 if close_up else 1.5)
        set_map_view(view, centre, half, ("" if close_up else "x [m]", "y [m]"))
        view.set_title(name, fontsize=11, color=INK)
    if not close_up:
        return figure
    side = 2.0 * half * _CLOSE_UP
    corner = close_up_corner([target_points, end], centre, half, side)
    for column, (name, points) in enumerate((("before", start), ("after", end))):
        whole, close = axes[:, column]
        draw_frame(whole, corner, side)
        overlay(close, target_points, points, 2.5)
        set_map_view(close, corner + 0.5 * side, 0.5 * side, ("x [m]", "y [m]"))
        close.set_title(f"{name}, inside the frame", fontsize=9, color=FAINT)
    return figure


def _obstacles(cloud: PointCloud) -> Points:
    obstacles = cloud.points[~segment(cloud).is_ground[cloud.rows]]
    return obstacles if len(obstacles) else cloud.points


def _title(result: RegistrationResult, truth: Pose | None) -> str:
    pose, origins = result.target_from_source, result.origins
    moved = math.hypot(*origins.shift(pose, origins.reference_point))
    turned = rotation_angle(pose.rotation)
    facts = [f"moved {moved:.2f} m", f"turned {math.degrees(turned):.2f}°"]
    if not math.isnan(result.overlap):
        facts.append(f"overlap {100 * result.overlap:.0f} %")
    if truth is not None:
        metres, radians = result.target_from_source.distance(truth)
        facts.append(f"off by {100 * metres:.1f} cm and {math.degrees(radians):.3f}°")
    status = result.status.value.replace("_", " ")
    return f"{result.method}: {status}\n{', '.join(facts)}"
