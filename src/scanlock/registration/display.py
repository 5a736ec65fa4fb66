"""Text and HTML tables of a result, for the command line, print and notebooks."""

import html
import math
from collections.abc import Sequence

import numpy as np

from scanlock.arrays import Vector
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.uncertainty.accuracy import PoseAccuracy
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability

Rows = list[tuple[str, str]]
"""Names and values; a value may have several lines."""


def accuracy_text(probability: float, accuracy: PoseAccuracy | None) -> str:
    """Return one sentence: the probability that the pose is right, and its deviations.

    A pose that is likely wrong has no accuracy.
    """
    right = "not verified" if math.isnan(probability) else f"right with {probability:.1%}"
    return right if accuracy is None or probability < 0.5 else f"{right}; {accuracy}"


def motion_rows(pose: Pose, origins: LocalOrigins) -> Rows:
    """Return the translation and the rotation of a pose; on a map at the source's centroid."""
    point = origins.reference_point
    shift = origins.shift(pose, point)
    turn = [math.degrees(radians) for radians in log_rotation(pose.rotation)]
    about = f" at the centroid, {triple(point, 0)} m" if origins.is_on_map else ""
    return [
        ("translation", f"{math.hypot(*shift):.3f} m: {triple(shift, 3)} along x, y, z{about}"),
        ("rotation", f"{math.hypot(*turn):.3f} deg: {triple(turn, 3)} about x, y, z"),
    ]


def matrix_lines(pose: Pose, *, on_map: bool = False) -> list[str]:
    """Return the four rows of the matrix of a pose, to copy into other tools.

    With every digit for map coordinates, where the seventh digit of a rotation is metres.
    """
    matrix = pose.matrix + 0.0
    if on_map:
        return [" ".join(f"{value:.17g}" for value in row) for row in matrix]
    width = max(len(f"{value:.5f}") for value in matrix[:, 3])
    return [
        " ".join(f"{value:11.8f}" for value in row[:3]) + f"  {row[3]:{width}.5f}"
        for row in np.where(np.abs(matrix) < 5e-9, 0.0, matrix)
    ]


def triple(values: Vector | list[float], digits: int) -> str:
    """Return three numbers with fixed digits."""
    # Adding zero turns -0.0 into 0.0.
    return ", ".join(f"{round(float(value), digits) + 0.0:.{digits}f}" for value in values)


def overlap_rows(metrics: Metrics) -> Rows:
    """Return the overlap of both scans, if it is known."""
    if math.isnan(metrics.overlap):
        return []
    both = f"{metrics.overlap:.0%} of the source, {metrics.target_overlap:.0%} of the target"
    return [("overlap", both)]


def metric_rows(metrics: Metrics) -> Rows:
    """Return every known metric other than the overlap, with its unit."""
    rows: Rows = []
    if not math.isnan(metrics.score):
        rows.append(("score", f"{metrics.score:.2f} (1 for identical scans)"))
    if not math.isnan(metrics.inlier_rmse):
        fitness = f"fitness {metrics.fitness:.0%}"
        rows.append(("inlier rmse", f"{metrics.inlier_rmse:.3f} m point to plane, {fitness}"))
    if not math.isnan(metrics.roughness):
        rows.append(("roughness", f"{metrics.roughness:.3f} m rmse of each scan with itself"))
    if not math.isnan(metrics.outlier_ratio):
        rows.append(("outliers", f"{metrics.outlier_ratio:.0%} of residuals above 2 sigma"))
    if not math.isnan(metrics.refinement_shift):
        rows.append(
            (
                "refinement",
                f"would move the pose by {metrics.refinement_shift:.3f} m, point to plane",
            )
        )
    if not math.isnan(metrics.free_space_violation):
        rows.append(
            (
                "free space",
                f"{metrics.free_space_violation:.0%} of clusters in the other's free space",
            )
        )
    if not math.isnan(metrics.runner_up_ratio):
        rows.append(("runner-up", f"scores {metrics.runner_up_ratio:.0%} of the pose"))
    return rows


def direction_rows(degenerate: Sequence[DirectionObservability]) -> Rows:
    """Return a row that lists the degenerate directions, or none."""
    return [("degenerate", "; ".join(str(one) for one in degenerate))] if degenerate else []


def text_table(rows: Rows) -> str:
    """Format rows as aligned lines."""
    width = max(len(name) for name, _ in rows)
    indent = "\n" + " " * (width + 2)
    return "\n".join(f"{name:<{width}}  {value.replace(chr(10), indent)}" for name, value in rows)


def html_table(rows: Rows) -> str:
    """Format rows as an HTML table."""
    cells = (
        f"<tr><th style='text-align:left;vertical-align:top'>{html.escape(name)}</th>"
        f"<td style='text-align:left;white-space:pre-wrap'>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    return f"<table>{''.join(cells)}</table>"
