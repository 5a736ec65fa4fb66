"""Report of a registration as one HTML page, to hand over or to keep."""

import base64
import html
import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from scanlock import __version__
from scanlock.arrays import Points, Vector
from scanlock.evaluation.closest_distances import closest_distances
from scanlock.geometry.pose import Pose
from scanlock.registration.display import Rows, html_table
from scanlock.registration.result import RegistrationResult
from scanlock.report.canvas import FAINT, INK, VERMILION, blank_figure
from scanlock.report.registration_figure import registration_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MAX_POINTS = 20_000
"""Maximum number of source points in the histogram of distances."""

_STYLE = """\
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 60em; margin: 2em auto; }
h1 { font-size: 1.5em; } h2 { font-size: 1.1em; margin-top: 2em; }
th { padding-right: 1.5em; font-weight: 600; } td { font-family: ui-monospace, monospace; }
pre { background: #f5f5f5; padding: 1em; overflow-x: auto; } img { max-width: 100%; }
.ok { color: #00734d; } .failed { color: #b00020; }
"""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class ReportedScan:
    """A scan of the report.

    Attributes
    ----------
    title : str
        Name, such as that of the file.
    facts : str
        Number of points, coordinate reference system and unit, in one line.
    points : (n, 3) [m]
        Finite points.
    """

    title: str
    facts: str
    points: Points


def registration_page(
    result: RegistrationResult,
    *,
    source: ReportedScan,
    target: ReportedScan,
    settings: str = "",
    initial: Pose | None = None,
) -> str:
    """Return a page with outcome, accuracy, pose, pictures, metrics and settings.

    The page needs no other file and no network. Equal results give equal pages.

    Parameters
    ----------
    result : RegistrationResult
    source, target : ReportedScan
    settings : str
        Settings of the method, as TOML.
    initial : Pose, optional
        Initial pose of the source, for the picture.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    """
    status, *summary = result.summary_rows()
    scans = [
        ("source", f"{source.title}, {source.facts}"),
        ("target", f"{target.title}, {target.facts}"),
    ]
    picture = registration_figure(
        result, source=source.points, target=target.points, initial=initial
    )
    distances = _distances(target.points, source.points, result.target_from_source)
    grade = "ok" if result.ok else "failed"
    parts = [
        f"<h1>{html.escape(source.title)} onto {html.escape(target.title)}</h1>",
        f"<p class='{grade}'><strong>{html.escape(status[1])}</strong></p>",
        html_table([*scans, *_with_deviations(summary, result)]),
        "<h2>Before and after</h2>",
        _image(picture),
        "<h2>Distances between the scans</h2>",
        _image(_histogram(distances)),
        f"<p>{html.escape(_distance_text(distances))}</p>",
        "<h2>Details</h2>",
        html_table([*result.detail_rows(), *(("note", note) for note in result.notes)]),
    ]
    if settings:
        summary_line = f"<summary>Settings of {html.escape(result.method)}</summary>"
        parts.append(f"<details>{summary_line}<pre>{html.escape(settings)}</pre></details>")
    parts.append(f"<p>scanlock {html.escape(__version__)}</p>")
    return _document(source.title, parts)


def _with_deviations(rows: Sequence[tuple[str, str]], result: RegistrationResult) -> Rows:
    """Return the summary with the deviations of every axis below the accuracy."""
    full: Rows = []
    for row in rows:
        full.append(row)
        if row[0] == "accuracy" and result.accuracy is not None and result.probability >= 0.5:
            full.append(("by axis", result.accuracy.details()))
    return full


def _distances(target: Points, source: Points, pose: Pose) -> Vector:
    """Return the distances of some moved source points to the closest target points [m]."""
    origin = np.round(np.median(target, axis=0))
    rows = np.linspace(0, len(source) - 1, min(len(source), _MAX_POINTS)).astype(np.int64)
    moved = pose.apply(source[rows]) - origin
    return closest_distances(target - origin, moved, Pose.identity())


def _histogram(distances: Vector) -> "Figure":
    figure = blank_figure(9.0, 2.8)
    axes = figure.subplots()
    end = max(float(np.percentile(distances, 95.0)), 1e-3)
    axes.hist(np.minimum(distances, end), bins=60, range=(0.0, end), color=VERMILION)
    axes.set_xlabel("distance to the closest point of the target [m]", fontsize=9, color=INK)
    axes.set_ylabel("points of the source", fontsize=9, color=INK)
    axes.tick_params(labelsize=8, colors=FAINT)
    return figure


def _distance_text(distances: Vector) -> str:
    quarter, half, most = np.percentile(distances, [25.0, 50.0, 90.0])
    return (
        f"Quartile {_millimetres(quarter)}, median {_millimetres(half)}, ninth decile "
        f"{_millimetres(most)}; the last bar holds the 5% above its end. The distances include the "
        "spacing of the points and surfaces that only one scan has: they are not the accuracy."
    )


def _millimetres(metres: float) -> str:
    return "unknown" if math.isnan(metres) else f"{1e3 * metres:.0f} mm"


def _image(figure: "Figure") -> str:
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=110, metadata={"Software": None})
    return f"<img alt='' src='data:image/png;base64,{base64.b64encode(data.getvalue()).decode()}'>"


def _document(title: str, parts: Sequence[str]) -> str:
    head = f"<meta charset='utf-8'><title>{html.escape(title)}</title><style>{_STYLE}</style>"
    return (
        f"<!doctype html><html lang='en'><head>{head}</head><body>{''.join(parts)}</body></html>\n"
    )
