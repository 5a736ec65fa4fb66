"""Scans with the labels of their points, for files."""

from dataclasses import replace
from typing import Any

import numpy as np

from scanlock.arrays import Labels
from scanlock.io.scan_file import ScanFile
from scanlock.report.label_colours import label_colours, viewer_fields

_COLOURED = (".ply", ".pcd")
"""Formats whose viewers show colours."""

_LAS = (".las", ".laz")

_CLASS, _GROUND, _UNCLASSIFIED = "classification", 2, 1
"""Field of LAS with the class of each point, and classes of the American Society for
Photogrammetry and Remote Sensing (ASPRS)."""

_NOISE = (7, 18)
"""Classes of noise, which are neither ground nor above it."""

_COLOURS = ("red", "green", "blue", "rgb", "rgba")


def labelled_scan(
    file: ScanFile, labels: Labels, suffix: str, *, colours: bool
) -> tuple[ScanFile, list[str]]:
    """Return a scan with its labels, and what was added to it.

    Parameters
    ----------
    file : ScanFile
    labels : (n,)
        0 ground, 1 and up clusters, -1 neither.
    suffix : str
        Extension of the output, lower case.
    colours : bool
        Whether to add colours, for formats with viewers that show them.

    Returns
    -------
    scan : ScanFile
        With a field of labels; with classes for LAS, and colours for PLY and PCD.
    added : list of str
        One text for each addition.
    """
    fields: dict[str, Any] = dict(file.fields)
    name = _free_name("label", fields)
    # Few other programs read 64-bit integers, and 32 bits suffice.
    fields[name] = labels.astype(np.int32)
    added = [f"field {name}: 0 ground, 1 and up clusters, -1 neither"]
    if suffix in _LAS:
        before = fields.get(_CLASS)
        if before is not None and (before > _UNCLASSIFIED).any():
            kept = _free_name(f"original_{_CLASS}", fields)
            fields[kept] = before
            added.append(f"field {kept}: the classes of the file")
        fields[_CLASS] = np.where(labels == 0, _GROUND, _UNCLASSIFIED).astype(np.uint8)
        added.append(f"field {_CLASS}: {_GROUND} ground, {_UNCLASSIFIED} all others")
    if suffix in _COLOURED and colours:
        replaced = [one for one in _COLOURS if fields.pop(one, None) is not None]
        fields.update(viewer_fields(label_colours(labels), suffix))
        note = "; those of the scan are replaced, --no-colours keeps them" if replaced else ""
        added.append(f"colours: brown ground, grey neither, a hue for each cluster{note}")
    return replace(file, fields=fields), added


def compared_ground(file: ScanFile, labels: Labels) -> dict[str, Any] | None:
    """Return how the ground agrees with class 2 of the file; None if the file has no such class.

    Points that the file calls noise are left out.
    """
    classes = file.fields.get(_CLASS)
    if classes is None or classes.ndim != 1 or not (classes == _GROUND).any():
        return None
    counted = ~np.isin(classes, _NOISE)
    stated, found = classes[counted] == _GROUND, labels[counted] == 0
    return {
        "points": int(stated.sum()),
        "agreement": float((stated == found).mean()),
        "recall": float(found[stated].mean()),
        "precision": float(stated[found].mean()) if found.any() else None,
    }


def _free_name(name: str, fields: dict[str, Any]) -> str:
    taken = {one.lower() for one in fields}
    return name if name not in taken else f"scanlock_{name}"
