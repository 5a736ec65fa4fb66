"""Figures as files that are the same, byte for byte, for the same scans."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.io import atomic_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURE_ENDINGS = (".png", ".svg")
"""One to look at anywhere, one to print."""

_METADATA: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".svg": {"Date": None, "Creator": None},
}
"""What Matplotlib would write about itself and the day."""


def save_pictures(folder: Path, name: str, figure: "Figure") -> list[Path]:
    """Write a figure as PNG and as SVG and return the two files."""
    from matplotlib import rc_context

    written: list[Path] = []
    for ending in PICTURE_ENDINGS:
        path = folder / f"{name}{ending}"
        # The names of an SVG's parts are drawn anew each time unless they are salted.
        with rc_context({"svg.hashsalt": name}), atomic_file(path) as handle:
            figure.savefig(handle, format=ending.removeprefix("."), metadata=_METADATA[ending])
        written.append(path)
    return written
