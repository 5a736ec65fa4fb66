"""Text and HTML tables of a result, for the command line and notebooks."""

import html
import math
from collections.abc import Sequence

from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability

Rows = list[tuple[str, str]]
"""Names and values."""


def metric_rows(metrics: Metrics) -> Rows:
    """Return every known metric with its unit."""
    rows: Rows = []
    if not math.isnan(metrics.overlap):
        both = f"{metrics.overlap:.0%} of the source, {metrics.target_overlap:.0%} of the target"
        rows.append(("overlap", both))
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
    return "\n".join(f"{name:<{width}}  {value}" for name, value in rows)


def html_table(rows: Rows) -> str:
    """Format rows as an HTML table."""
    cells = (
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(value)}</td></tr>"
        for name, value in rows
    )
    return f"<table>{''.join(cells)}</table>"
