"""Output folder of an experiment: page, tables, figures, trajectories, maps, settings."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scanlock import __version__
from scanlock.evaluation.crispness import VOXEL_SIZE
from scanlock.experiments.experiment import Claim, Experiment, Findings, Section
from scanlock.experiments.series import ScanSeries
from scanlock.io import atomic_file, write_kitti_poses, write_scan, write_tum_poses
from scanlock.registration.methods.protocol import Method
from scanlock.registration.settings.file import write_settings
from scanlock.report.canvas import save_figure

PAGE = "index.md"

_FIGURE_ENDINGS = (".png", ".svg")
"""Raster format for screens, vector format for print."""

_HOLDS = {True: "holds here", False: "**does not hold here**", None: "cannot be decided here"}

_TRUTHS = {
    "exact": "The true poses are those of the simulation and exact.",
    "given": "The poses of the data set count as true and have errors of their own.",
    "unknown": "The true poses are not known.",
}


def write_findings(
    folder: Path,
    title: str,
    preface: str,
    methods: Mapping[str, Method[Any]],
    findings: Findings,
) -> Path:
    """Write the results into a folder and return the path of the page.

    The files hold no times, dates or paths: equal findings give equal bytes.

    Parameters
    ----------
    folder : Path
        Output folder; created if necessary.
    title : str
        Heading of the page.
    preface : str
        Text below the heading, in Markdown.
    methods : mapping of str to Method
        Methods by name; their settings are written.
    findings : Findings
    """
    for subfolder, names in _names_of(findings, methods).items():
        if names:
            (folder / subfolder).mkdir(parents=True, exist_ok=True)
    for section in findings.sections:
        for name, table in section.tables.items():
            _write_text(folder / "tables" / f"{name}.csv", table.to_csv())
            _write_text(folder / "tables" / f"{name}.md", table.to_markdown())
        for name, figure in section.figures.items():
            for ending in _FIGURE_ENDINGS:
                save_figure(folder / "figures" / f"{name}{ending}", figure)
    for name, poses in findings.trajectories.items():
        path = folder / "trajectories" / file_name(name)
        write_kitti_poses(path.with_suffix(".kitti.txt"), poses)
        write_tum_poses(path.with_suffix(".tum.txt"), findings.times, poses)
    for name, points in findings.maps.items():
        write_scan(folder / "maps" / f"{file_name(name)}.ply", points)
    for name, method in methods.items():
        write_settings(folder / "settings" / f"{file_name(name)}.toml", method)
    page = folder / PAGE
    files = _files(findings, methods)
    sections = [_section(section) for section in findings.sections]
    _write_text(page, "\n".join([f"# {title}\n", f"{preface}\n", *sections, files]))
    return page


def preface(experiment: Experiment, series: ScanSeries) -> str:
    """Return the description of the experiment, the scans, and the settings of the methods."""
    remarks = "".join(f"- {one.name}: {one.remark}.\n" for one in experiment.contenders)
    return (
        f"{experiment.description}\n\n## Registered scans\n\n{series_text(series)}, "
        f"{experiment.pairs_text}. {truth_sentence(series)}\n\n{remarks}"
    )


def series_text(series: ScanSeries) -> str:
    """Return a phrase on the scans, their origin and the version of scanlock."""
    origin = f"`{series.origin}`, " if series.origin else ""
    return f"{series.title} ({origin}scanlock {__version__})"


def truth_sentence(series: ScanSeries) -> str:
    """Return the sentence on the origin of the true poses."""
    return _TRUTHS[series.truth_kind]


def file_name(name: str) -> str:
    """Return a name in the form that file names have."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def _section(section: Section) -> str:
    blocks = [f"## {section.title}\n"]
    if section.text:
        blocks.append(f"{section.text}\n")
    for name, table in section.tables.items():
        if len(table.rows) > _MAX_ROWS:
            blocks.append(f"{len(table.rows):,} rows: [{name}.csv](tables/{name}.csv)\n")
        else:
            blocks.append(table.to_markdown())
    blocks += [f"![{name}](figures/{name}.png)\n" for name in section.figures]
    if section.claims:
        blocks.append("".join(_claim(claim) for claim in section.claims))
    if section.remarks:
        blocks.append("".join(f"- {remark}\n" for remark in section.remarks))
    return "\n".join(blocks)


_MAX_ROWS = 30
"""Maximum number of rows of a table on the page."""


def _claim(claim: Claim) -> str:
    return f"- “{claim.statement}” {_HOLDS[claim.holds]}: {claim.reason}.\n"


def _files(findings: Findings, methods: Mapping[str, Method[Any]]) -> str:
    names = {folder: ", ".join(found) for folder, found in _names_of(findings, methods).items()}
    rows = {
        "tables": f"{names['tables']}: full precision (.csv) and rounded (.md)",
        "figures": f"{names['figures']}: .png and .svg",
        "trajectories": f"{names['trajectories']}: poses of the scans in the first scan, "
        "in KITTI and TUM format",
        "settings": f"{names['settings']}: all settings of the method (.toml), for "
        "`scanlock register --settings`",
        "maps": f"{names['maps']}: one point per filled voxel of {VOXEL_SIZE:g} m (.ply)",
    }
    lines = [
        "- `records.jsonl`: all registrations with poses\n",
        "- `times.jsonl`: their wall times without compiling, which differ from run to run\n",
    ]
    lines += [f"- `{folder}/`: {text}\n" for folder, text in rows.items() if names[folder]]
    return "## Files\n\n" + "".join(lines)


def _names_of(findings: Findings, methods: Mapping[str, Method[Any]]) -> dict[str, list[str]]:
    return {
        "tables": [name for section in findings.sections for name in section.tables],
        "figures": [name for section in findings.sections for name in section.figures],
        "trajectories": [file_name(name) for name in findings.trajectories],
        "maps": [file_name(name) for name in findings.maps],
        "settings": [file_name(name) for name in methods],
    }


def _write_text(path: Path, text: str) -> None:
    with atomic_file(path) as handle:
        handle.write(text.encode())
