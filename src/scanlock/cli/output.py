"""Where results go: endings checked before the work, folders made, files whole or not at all."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.cli.errors import nearest
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.geometry.pose import Pose

POSE_ENDINGS = (".txt", ".json", ".npy")

_EACH_UP_TO = 200
"""So many rows take about 10 ms to write: less than it takes to find one of them."""


def require_ending(path: Path, endings: Sequence[str], what: str) -> None:
    """Raise `InvalidInput` unless a file's name ends as one of these; says which comes nearest."""
    suffix = path.suffix.lower()
    if suffix in endings:
        return
    hint = nearest(suffix, endings)
    raise InvalidInput(f"{what} must end in {', '.join(endings)}, got {path.name!r}{hint}")


def require_picture(path: Path) -> None:
    """Raise unless a picture can be drawn into a file of this name, before the work is done."""
    from scanlock.report.canvas import FIGURE_ENDINGS, require_figures

    require_ending(path, FIGURE_ENDINGS, "the picture")
    require_figures()


def require_apart(path: Path, inputs: Sequence[Path]) -> None:
    """Raise `InvalidInput` if a file to write is one that is read: scans are hard to replace."""
    for other in inputs:
        if path.exists() and other.exists() and path.samefile(other):
            raise InvalidInput(f"{path} is what is read and would be lost; name another file")


def make_room(path: Path) -> None:
    """Create the folder that a file goes into."""
    path.parent.mkdir(parents=True, exist_ok=True)


def is_worth_keeping(count: int) -> bool:
    """Tell whether rows that grow by one at a time are to be written anew at so many of them.

    After each of the first 200, and then at every further half per cent, so that the work of
    writing grows no faster than the rows do; a kill costs no more than the last of these.
    """
    return count % (1 + count // _EACH_UP_TO) == 0


def save_pose(path: Path, pose: "Pose", result: Mapping[str, Any]) -> None:
    """Write a pose as the ending says: the 4x4 matrix in text or NumPy's format, or all as JSON.

    Every number keeps all its digits; the three can be read back as an initial pose.
    """
    import numpy as np

    from scanlock.io import atomic_file, write_pose

    make_room(path)
    suffix = path.suffix.lower()
    if suffix == ".txt":
        write_pose(path, pose)
        return
    with atomic_file(path) as handle:
        if suffix == ".npy":
            np.lib.format.write_array(handle, pose.matrix, allow_pickle=False)
        else:
            handle.write((json.dumps(result, indent=2, allow_nan=False) + "\n").encode())
