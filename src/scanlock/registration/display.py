"""What a result says, in the words that people read: at the command line and in a notebook."""

import html
import math
from collections.abc import Sequence

from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability

Rows = list[tuple[str, str]]
"""Names and what is said of them."""


def metric_rows(metrics: Metrics) -> Rows:
    """Return every metric that is known, with its unit."""
    rows: Rows = []
    if not math.isnan(metrics.overlap):
        met = f"{metrics.overlap:.0%} of the source meets the target"
        rows.append(("overlap", f"{met}, {metrics.target_overlap:.0%} of the target the source"))
        rows.append(("score", f"{metrics.score:.2f}, of 1 for identical scans"))
    if not math.isnan(metrics.inlier_rmse):
        found = f"{metrics.fitness:.0%} of the source finds a surface"
        rows.append(("inlier rmse", f"{metrics.inlier_rmse:.3f} m to the surface; {found}"))
    if not math.isnan(metrics.roughness):
        rows.append(("roughness", f"{metrics.roughness:.3f} m of each scan to its own surface"))
    if not math.isnan(metrics.outlier_ratio):
        rows.append(
            ("misfit", f"{metrics.outlier_ratio:.0%} lies off the surface more than it scatters")
        )
    if not math.isnan(metrics.refinement_shift):
        rows.append(
            (
                "drift",
                f"{metrics.refinement_shift:.3f} m, to where it comes to rest on the surfaces",
            )
        )
    if not math.isnan(metrics.free_space_violation):
        seen = "of what either scan shows stands where the other looked through"
        rows.append(("free-space violation", f"{metrics.free_space_violation:.0%} {seen}"))
    if not math.isnan(metrics.runner_up_ratio):
        rows.append(("second best", f"another pose agrees {metrics.runner_up_ratio:.0%} as well"))
    return rows


def direction_rows(weak: Sequence[DirectionObservability]) -> Rows:
    """Return what is said of the directions that the scans leave open."""
    return [("weak", "; ".join(str(one) for one in weak))] if weak else []


def text_table(rows: Rows) -> str:
    """Return rows as aligned lines."""
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {said}" for name, said in rows)


def html_table(rows: Rows) -> str:
    """Return rows as a table for notebooks."""
    cells = (
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(said)}</td></tr>"
        for name, said in rows
    )
    return f"<table>{''.join(cells)}</table>"
