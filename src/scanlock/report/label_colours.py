"""Colours of segmented points for files: ground, clusters and all others."""

import colorsys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels
from scanlock.segmentation.segmentation import GROUND, LEFT_OUT

_GROUND = (150, 130, 105)
_LEFT_OUT = (90, 90, 90)

_GOLDEN_RATIO = 0.5 * (5.0**0.5 - 1.0)
"""Step of the hue between consecutive clusters, in turns; consecutive hues differ most."""

_TONES = ((0.85, 0.95), (0.6, 1.0), (0.95, 0.75))
"""Saturations and values of colours in turn."""


def label_colours(labels: Labels) -> NDArray[np.uint8]:
    """Return a colour for each label: brown for ground, grey for neither, and hues for clusters.

    Parameters
    ----------
    labels : (n,)
        As in `scanlock.Segmentation`: 0 ground, 1 and up clusters, -1 neither.

    Returns
    -------
    (n, 3) of uint8
        Red, green and blue.
    """
    distinct, rows = np.unique(labels, return_inverse=True)
    return np.array([_colour(int(label)) for label in distinct], np.uint8)[rows]


def viewer_fields(colours: NDArray[np.uint8], suffix: str) -> dict[str, NDArray[Any]]:
    """Return colours as the fields that viewers of a format show.

    Parameters
    ----------
    colours : (n, 3) of uint8
    suffix : str
        Extension of the file, lower case.

    Returns
    -------
    dict of str to (n,)
        ``rgb`` for .pcd: the bytes 0, red, green, blue as one float32, as the Point Cloud Library
        has it. ``red``, ``green`` and ``blue`` otherwise.
    """
    red, green, blue = colours.T
    if suffix != ".pcd":
        return {"red": red, "green": green, "blue": blue}
    wide = colours.astype(np.uint32)
    return {"rgb": ((wide[:, 0] << 16) | (wide[:, 1] << 8) | wide[:, 2]).view(np.float32)}


def _colour(label: int) -> tuple[int, int, int]:
    if label == GROUND:
        return _GROUND
    if label == LEFT_OUT:
        return _LEFT_OUT
    saturation, value = _TONES[label % len(_TONES)]
    red, green, blue = colorsys.hsv_to_rgb(label * _GOLDEN_RATIO % 1.0, saturation, value)
    return round(255 * red), round(255 * green), round(255 * blue)
