"""What an experiment leaves in its folder, and the page that leads through it."""

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

_PICTURES = (".png", ".svg")
"""One to look at anywhere, one to print."""

_HOLDS = {True: "holds here", False: "**does not hold here**", None: "cannot be told here"}

_TRUTHS = {
    "exact": "The true poses are those of the simulation, exact.",
    "given": "What is called true are the poses that came with the scans, with their own errors.",
    "unknown": "The true poses are not known.",
}


def write_findings(
    folder: Path,
    title: str,
    preface: str,
    methods: Mapping[str, Method[Any]],
    findings: Findings,
) -> Path:
    """Write everything that was found into a folder and return the page that leads through it.

    The same findings give the same bytes: there are no times, dates or places in the files.

    Parameters
    ----------
    folder : Path
        Created if it is not there.
    title : str
        The heading of the page.
    preface : str
        What stands below it, in Markdown.
    methods : mapping of str to Method
        Whose settings are written out, by name.
    findings : Findings
    """
    for part, names in _names_of(findings, methods).items():
        if names:
            (folder / part).mkdir(parents=True, exist_ok=True)
    for section in findings.sections:
        for name, table in section.tables.items():
            _write_text(folder / "tables" / f"{name}.csv", table.to_csv())
            _write_text(folder / "tables" / f"{name}.md", table.to_markdown())
        for name, figure in section.figures.items():
            for ending in _PICTURES:
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
    """Return what the paper did, what is done here instead, and by which settings."""
    remarks = "".join(f"- {one.name}: {one.remark}.\n" for one in experiment.contenders)
    return (
        f"{experiment.about}\n\n## What was registered here\n\n{described(series)}, "
        f"{experiment.pairing}. {truth_sentence(series)}\n\n{remarks}"
    )


def described(series: ScanSeries) -> str:
    """Return what was registered and where it comes from."""
    origin = f"`{series.origin}`, " if series.origin else ""
    return f"{series.title} ({origin}scanlock {__version__})"


def truth_sentence(series: ScanSeries) -> str:
    """Return where the true poses come from."""
    return _TRUTHS[series.truth_kind]


def file_name(name: str) -> str:
    """Return a name as part of a file's."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def _section(section: Section) -> str:
    parts = [f"## {section.title}\n"]
    if section.text:
        parts.append(f"{section.text}\n")
    for name, table in section.tables.items():
        if len(table.rows) > _LONGEST:
            parts.append(f"{len(table.rows):,} rows: [{name}.csv](tables/{name}.csv)\n")
        else:
            parts.append(table.to_markdown())
    parts += [f"![{name}](figures/{name}.png)\n" for name in section.figures]
    if section.claims:
        parts.append("".join(_claim(claim) for claim in section.claims))
    if section.remarks:
        parts.append("".join(f"- {remark}\n" for remark in section.remarks))
    return "\n".join(parts)


_LONGEST = 30
"""Longer tables are not shown on the page."""


def _claim(claim: Claim) -> str:
    return f"- “{claim.says}” {_HOLDS[claim.holds]}: {claim.because}.\n"


def _files(findings: Findings, methods: Mapping[str, Method[Any]]) -> str:
    names = {part: ", ".join(found) for part, found in _names_of(findings, methods).items()}
    rows = {
        "tables": f"{names['tables']}: every digit (.csv), and rounded (.md)",
        "figures": f"{names['figures']}: .png and .svg",
        "trajectories": f"{names['trajectories']}: first scan from each scan, 12 numbers a row "
        "(.kitti.txt) and stamped (.tum.txt)",
        "settings": f"{names['settings']}: every setting of the method (.toml), as `scanlock "
        "register --settings` reads it",
        "maps": f"{names['maps']}: one point in each filled voxel of {VOXEL_SIZE:g} m (.ply)",
    }
    lines = ["- `records.jsonl`: every registration, with its pose, in full\n"]
    lines += [f"- `{part}/`: {what}\n" for part, what in rows.items() if names[part]]
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
