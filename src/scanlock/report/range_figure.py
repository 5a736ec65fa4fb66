"""Figure of range images with a common colour scale."""

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
"""Percentile of the ranges at which the colours end; a few returns are far away."""


def range_figure(images: Mapping[str, Matrix]) -> "Figure":
    """Return a figure of range images, grey without a return.

    Parameters
    ----------
    images : mapping of str to (r, c) [m]
        Range images by title; NaN without a return.

    Raises
    ------
    MissingExtra
        Matplotlib is not installed.
    InvalidInput
        There is no image, or no image has a range.
    """
    finite = [image[np.isfinite(image)] for image in images.values()]
    if not sum(len(ranges) for ranges in finite):
        raise InvalidInput(
            f"range images need at least one range, got {len(images)} images without any"
        )
    farthest = float(np.percentile(np.concatenate(finite), _SHOWN_SHARE))
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
