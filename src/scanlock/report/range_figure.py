"""Range images of a ladar, one above the other, in one scale of colours."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from scanlock.arrays import Matrix
from scanlock.errors import InvalidInput
from scanlock.report.canvas import FAINT, GROUND, INK, blank_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = "viridis_r"
_SHOWN_SHARE = 98.0
"""Colours end at this percentage of the ranges: a few far returns would take up all of them."""


def range_figure(images: Mapping[str, Matrix]) -> "Figure":
    """Return a figure of range images as the sensor took them, grey where nothing came back.

    Parameters
    ----------
    images : mapping of str to (r, c) [m]
        By what they show; NaN where empty.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        No image, or none with a range.
    """
    seen = [image[np.isfinite(image)] for image in images.values()]
    if not sum(len(ranges) for ranges in seen):
        raise InvalidInput(f"range images must hold a range, got {len(images)} without any")
    farthest = float(np.percentile(np.concatenate(seen), _SHOWN_SHARE))
    figure = blank_figure(9.0, 0.6 + 1.9 * len(images))
    rows = figure.subplots(len(images), 1, squeeze=False)[:, 0]
    for axes, (title, image) in zip(rows, images.items(), strict=True):
        axes.set_facecolor(GROUND)
        axes.imshow(
            image, cmap=_COLOURS, vmin=0.0, vmax=farthest, aspect="auto", interpolation="nearest"
        )
        empty = int(np.isnan(image).sum())
        axes.set_title(f"{title}: {image.size - empty:,} points", fontsize=10, color=INK)
        axes.set_ylabel("row", fontsize=8, color=FAINT)
        axes.tick_params(labelsize=8, colors=FAINT, length=2)
    rows[-1].set_xlabel("column", fontsize=8, color=FAINT)
    bar = figure.colorbar(rows[0].get_images()[0], ax=list(rows), pad=0.015)
    bar.set_label("range [m]", fontsize=8, color=INK)
    bar.ax.tick_params(labelsize=8)
    return figure
