"""``scanlock segment``: the ground and the clusters of a scan file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from scanlock.cli.option_types import Flag, OutputFile
from scanlock.cli.scan_input import LoadedScan, Reading
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.arrays import Labels
    from scanlock.cli.console import Facts
    from scanlock.segmentation.segmentation import Segmentation

_LABEL_ENDINGS = (".npy", ".txt", ".csv", ".label")
_SCAN_ENDINGS = (".ply", ".pcd", ".npz", ".las", ".laz")

_OTHER_GROUND, _OTHER_OBJECT, _UNLABELLED = 49, 99, 0
"""SemanticKITTI's classes for other ground, other object and unlabelled."""

_MAX_INSTANCES = 2**16 - 1
"""Largest instance number in the upper 16 bits of a SemanticKITTI label."""


def segment(
    scan: Path,
    /,
    *,
    settings: Path | None = None,
    output: OutputFile = None,
    colours: Annotated[bool, Parameter(negative="--no-colours")] = True,
    picture: Path | None = None,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Segment a scan into ground and the clusters above it.

    Parameters
    ----------
    scan : Path
        Scan file.
    settings : Path
        Your own settings: TOML as printed by scanlock settings segment.
    output : Path
        File of labels (.npy, .txt, .csv, .label) or of the labelled scan (.ply, .pcd, .npz, .las,
        .laz).
    colours : bool
        Colour the points of .ply and .pcd by their label.
    picture : Path
        Figure of the ground and the clusters: .png, .pdf or .svg.
    json : bool
        Print the summary as JSON, and nothing else.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_facts, print_json, print_line, print_title
    from scanlock.cli.output import (
        require_apart,
        require_ending,
        require_folder,
        require_picture,
    )
    from scanlock.registration.settings.file import read_settings_like
    from scanlock.report.labelled_scan import compared_ground
    from scanlock.segmentation.segmentation import Segmenter
    from scanlock.segmentation.segmentation import segment as segmented

    if output is not None:
        require_ending(output, (*_LABEL_ENDINGS, *_SCAN_ENDINGS), "the output")
        require_apart(output, (scan,))
        require_folder(output)
    if picture is not None:
        require_picture(picture)
        require_folder(picture)
    segmenter = Segmenter() if settings is None else read_settings_like(settings, Segmenter())
    loaded = (reading or Reading()).load(scan)
    with compile_watch():
        found = segmented(loaded.points, segmenter)
    wrote: list[str] = []
    if output is not None:
        wrote.extend(_write(output, loaded, found, colours=colours))
    if picture is not None:
        wrote.append(_draw(picture, found))
    summary = _summary(found) | {
        "file_ground": compared_ground(loaded.file, found.labels),
        "notes": list(loaded.file.notes),
    }
    if json:
        print_json({"scan": str(scan), **summary})
        return
    print_title(loaded.summary())
    print_facts(_facts(summary))
    for text in wrote:
        print_line(text)


def _summary(found: "Segmentation") -> dict[str, Any]:
    import math

    ground = found.ground
    sizes = sorted((len(rows) for rows in found.clusters), reverse=True)
    height = ground.sensor_height
    return {
        "points": len(found.labels),
        "ground_points": int(found.is_ground.sum()),
        "cluster_points": sum(sizes),
        "left_out_points": int((found.labels == -1).sum()),
        "clusters": found.cluster_count,
        "largest_cluster": sizes[0] if sizes else 0,
        "median_cluster": sizes[len(sizes) // 2] if sizes else 0,
        "ground_status": ground.status.value,
        "ground_reason": ground.reason,
        "sensor_height_m": None if math.isnan(height) else height,
        "ground_tilt_deg": math.degrees(ground.tilt),
    }


def _facts(summary: dict[str, Any]) -> "Facts":
    def count(key: str) -> str:
        return f"{summary[key]:,} points, {100 * summary[key] / summary['points']:.1f} %"

    facts = [
        ("ground", count("ground_points")),
        ("", f"{summary['ground_status']}: {summary['ground_reason']}"),
    ]
    if summary["sensor_height_m"] is not None:
        height, tilt = summary["sensor_height_m"], summary["ground_tilt_deg"]
        facts.append(("sensor", f"{height:.2f} m above the ground, tilted by {tilt:.1f} deg"))
    sizes = f"{summary['median_cluster']:,} points in the median, {summary['largest_cluster']:,}"
    return [
        *facts,
        *_comparison(summary["file_ground"]),
        ("clusters", f"{summary['clusters']:,} of {count('cluster_points')}"),
        ("", f"{sizes} in the largest"),
        ("neither", count("left_out_points")),
        *(("note", note) for note in summary["notes"]),
    ]


def _comparison(file_ground: dict[str, Any] | None) -> "Facts":
    """Return the agreement with the ground of the file, if it has one."""
    if file_ground is None:
        return []
    texts = [f"{100 * file_ground['recall']:.1f} % found"]
    if file_ground["precision"] is not None:
        texts.append(f"{100 * file_ground['precision']:.1f} % of the ground found is class 2")
    texts.append(f"{100 * file_ground['agreement']:.1f} % of all points agree")
    return [("class 2", f"{file_ground['points']:,} points of the file: {'; '.join(texts)}")]


def _write(path: Path, loaded: LoadedScan, found: "Segmentation", *, colours: bool) -> list[str]:
    from scanlock.io import write_labels, write_scan
    from scanlock.report.labelled_scan import labelled_scan

    suffix = path.suffix.lower()
    if suffix == ".label":
        write_labels(path, semantic_kitti_labels(found.labels))
        return [f"wrote {path}: 49 ground, 99 clusters with their number above 16 bits, 0 neither"]
    if suffix in _LABEL_ENDINGS:
        write_labels(path, found.labels)
        return [f"wrote {path}: one label a row, 0 ground, 1 and up clusters, -1 neither"]
    labelled, added = labelled_scan(loaded.file, found.labels, suffix, colours=colours)
    write_scan(path, labelled)
    return [f"wrote {path}: the scan with", *(f"  {text}" for text in added)]


def semantic_kitti_labels(labels: "Labels") -> "Labels":
    """Pack labels as in SemanticKITTI: class in the lower 16 bits, instance in the upper ones.

    Raises
    ------
    InvalidInput
        More than 65535 clusters.
    """
    import numpy as np

    if labels.max() > _MAX_INSTANCES:
        raise InvalidInput(
            f"a .label file holds at most {_MAX_INSTANCES} clusters, got {labels.max()}; write .npy"
        )
    packed = np.where(labels > 0, _OTHER_OBJECT + (labels << 16), _UNLABELLED)
    return np.where(labels == 0, _OTHER_GROUND, packed)


def _draw(path: Path, found: "Segmentation") -> str:
    from scanlock.report.canvas import save_figure
    from scanlock.report.segmentation_figure import segmentation_figure

    save_figure(path, segmentation_figure(found))
    return f"wrote {path}"
