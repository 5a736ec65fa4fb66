"""Output files: check names before the work, create folders, write atomically."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.cli.errors import nearest
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.geometry.pose import Pose
    from scanlock.io import ScanFile

POSE_ENDINGS = (".txt", ".json", ".npy")

_EACH_UP_TO = 200
"""Number of rows up to which a table is rewritten after each; that takes about 10 ms."""


def require_ending(path: Path, endings: Sequence[str], subject: str) -> None:
    """Raise `InvalidInput` unless a file name has one of the endings."""
    suffix = path.suffix.lower()
    if suffix in endings:
        return
    hint = nearest(suffix, endings)
    raise InvalidInput(f"{subject} must end in {', '.join(endings)}, got {path.name!r}{hint}")


def require_picture(path: Path) -> None:
    """Raise unless a picture can be written under this name."""
    from scanlock.report.canvas import FIGURE_ENDINGS, require_figures

    require_ending(path, FIGURE_ENDINGS, "the picture")
    require_figures()


def require_apart(path: Path, inputs: Sequence[Path]) -> None:
    """Raise `InvalidInput` if an output file is one of the input files."""
    from scanlock.io.formats.stations import split_station

    for named in inputs:
        other, _ = split_station(named)
        if path.exists() and other.exists() and path.samefile(other):
            raise InvalidInput(
                f"{path} is an input file and would be overwritten; use another name"
            )


def require_folder(path: Path) -> None:
    """Raise `InvalidInput` unless the folder of an output file exists."""
    if not path.parent.is_dir():
        raise InvalidInput(f"{path.parent} is no folder, so {path.name} cannot be written; make it")


def require_scan_file(path: Path) -> None:
    """Raise `InvalidInput` unless the ending of a file is that of a format that is written."""
    from scanlock.io.formats.registry import FORMATS

    written = [known for known in FORMATS.values() if known.write is not None]
    endings = [ending for known in written for ending in known.extensions]
    require_ending(path, endings, "the cloud")


def write_cloud(path: Path, scan: "ScanFile") -> "ScanFile":
    """Write a cloud for other tools, and return it as it was written.

    Rows without a return are left out, unless the cloud is organised. Fields are fitted to LAS.
    """
    from scanlock.io import write_scan
    from scanlock.io.formats.las.fitted import fitted_to_las
    from scanlock.io.formats.registry import format_of_name
    from scanlock.io.transform import has_return, keep_rows

    is_las = format_of_name(path) == "las"
    if is_las or scan.height == 1:
        scan = keep_rows(scan, has_return(scan))
    if is_las:
        scan = fitted_to_las(scan)
    write_scan(path, _with_viewer_colours(scan, path.suffix.lower()))
    return scan


def _with_viewer_colours(scan: "ScanFile", suffix: str) -> "ScanFile":
    """Return a scan with colours of 8 bits as the viewers of a format expect them."""
    import numpy as np

    from scanlock.report.label_colours import viewer_fields

    names = ("red", "green", "blue")
    if not all(name in scan.fields and scan.fields[name].dtype == np.uint8 for name in names):
        return scan
    colours = np.stack([scan.fields[name] for name in names], axis=1)
    others = {name: values for name, values in scan.fields.items() if name not in names}
    return replace(scan, fields={**others, **viewer_fields(colours, suffix)})


def is_due(count: int) -> bool:
    """Return whether to rewrite a growing table at this number of rows.

    After each of the first 200 rows, then after every further 0.5 %, so that the total work stays
    proportional to the number of rows. A kill loses at most those rows.
    """
    return count % (1 + count // _EACH_UP_TO) == 0


def save_pose(path: Path, pose: "Pose", result: Mapping[str, Any], comment: str = "") -> None:
    """Write a pose by the ending: the 4x4 matrix as text or .npy, or the whole result as JSON.

    Numbers keep all digits. Each format can be read back as an initial pose. The comment is the
    first line of the text.
    """
    import numpy as np

    from scanlock.io import atomic_file, write_pose

    suffix = path.suffix.lower()
    if suffix == ".txt":
        write_pose(path, pose, comment)
        return
    with atomic_file(path) as handle:
        if suffix == ".npy":
            np.lib.format.write_array(handle, pose.matrix, allow_pickle=False)
        else:
            handle.write((json.dumps(result, indent=2, allow_nan=False) + "\n").encode())
