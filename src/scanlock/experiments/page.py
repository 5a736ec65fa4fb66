"""What an experiment leaves in its folder, and the page that leads through it."""

import re
from collections.abc import Mapping
from pathlib import Path

from scanlock import __version__
from scanlock.experiments.experiment import Claim, Experiment, Findings, Outcome, Section
from scanlock.io import atomic_file, write_kitti_poses, write_scan, write_tum_poses
from scanlock.report.pictures import save_pictures

PAGE = "index.md"

_HOLDS = {True: "holds here", False: "**does not hold here**", None: "cannot be told here"}

_TRUTHS = {
    "exact": "The true poses are those of the simulation, exact.",
    "given": "What is called true are the poses that came with the scans, with their own errors.",
    "unknown": "The true poses are not known.",
}


def write_findings(
    folder: Path, experiment: Experiment, outcome: Outcome, findings: Findings
) -> Path:
    """Write everything that was found into a folder and return the page that leads through it.

    The same findings give the same bytes: there are no times, dates or places in the files.
    """
    for part in ("tables", "figures", "trajectories", "maps"):
        (folder / part).mkdir(parents=True, exist_ok=True)
    for section in findings.sections:
        for name, table in section.tables.items():
            _write_text(folder / "tables" / f"{name}.csv", table.to_csv())
            _write_text(folder / "tables" / f"{name}.md", table.to_markdown())
        for name, figure in section.figures.items():
            save_pictures(folder / "figures", name, figure)
    for name, poses in findings.trajectories.items():
        path = folder / "trajectories" / file_name(name)
        write_kitti_poses(path.with_suffix(".kitti.txt"), poses)
        write_tum_poses(path.with_suffix(".tum.txt"), outcome.series.times, poses)
    for name, points in findings.maps.items():
        write_scan(folder / "maps" / f"{file_name(name)}.ply", points)
    page = folder / PAGE
    _write_text(page, _page(experiment, outcome, findings))
    return page


def file_name(name: str) -> str:
    """Return a name as part of a file's."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")


def _page(experiment: Experiment, outcome: Outcome, findings: Findings) -> str:
    series = outcome.series
    parts = [
        f"# {experiment.title}\n",
        f"{experiment.about}\n",
        "## What was registered here\n",
        f"{series.title}, each with the one before. {_TRUTHS[series.truth_kind]} "
        f"The scans come from: `{series.origin}`. scanlock {__version__}.\n",
        "".join(f"- {one.name}: {one.remark}.\n" for one in experiment.contenders),
        *(_section(section) for section in findings.sections),
        _files(findings),
    ]
    return "\n".join(parts)


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


def _files(findings: Findings) -> str:
    tables = [name for section in findings.sections for name in section.tables]
    figures = [name for section in findings.sections for name in section.figures]
    rows: Mapping[str, str] = {
        "records.jsonl": "every registration, with its pose, in full",
        "settings.toml": "every setting of every method",
        "tables/": ", ".join(f"{name} (.csv in full, .md rounded)" for name in tables),
        "figures/": ", ".join(f"{name} (.png, .svg)" for name in figures),
        "trajectories/": "first scan from each scan, 12 numbers a row (.kitti.txt) and stamped "
        "(.tum.txt): " + ", ".join(map(file_name, findings.trajectories)),
        "maps/": "one point in each filled voxel of 0.1 m (.ply): "
        + ", ".join(map(file_name, findings.maps)),
    }
    return "## Files\n\n" + "".join(f"- `{name}`: {what}\n" for name, what in rows.items())


def _write_text(path: Path, text: str) -> None:
    with atomic_file(path) as handle:
        handle.write(text.encode())
