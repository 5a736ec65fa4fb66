"""``scanlock segment``: the ground and the clusters of a scan file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    output: OutputFile = None,
    picture: Path | None = None,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Segment a scan into ground and the clusters above it.

    Parameters
    ----------
    scan : Path
        Scan file.
    output : Path
        File of labels (.npy, .txt, .csv, .label) or of the labelled scan (.ply, .pcd, .npz, .las,
        .laz).
    picture : Path
        Figure of the ground and the clusters: .png, .pdf or .svg.
    json : bool
        Print the summary as JSON, and nothing else.
    """
    from scanlock.cli.compile_notice import compile_watch
    from scanlock.cli.console import print_facts, print_json, print_line, print_title
    from scanlock.cli.output import make_room, require_apart, require_ending, require_picture
    from scanlock.segmentation.segmentation import segment as segmented

    if output is not None:
        require_ending(output, (*_LABEL_ENDINGS, *_SCAN_ENDINGS), "the output")
        require_apart(output, (scan,))
    if picture is not None:
        require_picture(picture)
    loaded = (reading or Reading()).load(scan)
    with compile_watch():
        found = segmented(loaded.points)
    wrote: list[str] = []
    if output is not None:
        make_room(output)
        wrote.append(_write(output, loaded, found))
    if picture is not None:
        make_room(picture)
        wrote.append(_draw(picture, found))
    summary = _summary(found)
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
        ("clusters", f"{summary['clusters']:,} of {count('cluster_points')}"),
        ("", f"{sizes} in the largest"),
        ("neither", count("left_out_points")),
    ]


def _write(path: Path, loaded: LoadedScan, found: "Segmentation") -> str:
    from scanlock.io import write_labels, write_scan

    suffix = path.suffix.lower()
    if suffix == ".label":
        write_labels(path, semantic_kitti_labels(found.labels))
        return f"wrote {path}: 49 ground, 99 clusters with their number above 16 bits, 0 neither"
    if suffix in _LABEL_ENDINGS:
        write_labels(path, found.labels)
        return f"wrote {path}: one label a row, 0 ground, 1 and up clusters, -1 neither"
    name = _free_name(loaded)
    file = loaded.file
    # Few other programs read 64-bit integers, and 32 bits suffice.
    fields = {**file.fields, name: found.labels.astype("int32")}
    points = file.points.astype("float32" if file.coordinate_dtype == "float32" else "float64")
    is_pcd = suffix == ".pcd"
    write_scan(
        path,
        points,
        fields,
        height=file.height if is_pcd else 1,
        viewpoint=file.viewpoint if is_pcd else None,
    )
    return f"wrote {path}: the scan with a field {name}, 0 ground, 1 and up clusters, -1 neither"


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


def _free_name(loaded: LoadedScan) -> str:
    taken = {name.lower() for name in loaded.file.fields}
    return "label" if "label" not in taken else "scanlock_label"


def _draw(path: Path, found: "Segmentation") -> str:
    from scanlock.report.canvas import save_figure
    from scanlock.report.segmentation_figure import segmentation_figure

    save_figure(path, segmentation_figure(found))
    return f"wrote {path}"
