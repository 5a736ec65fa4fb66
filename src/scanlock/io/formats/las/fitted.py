"""Fields of other formats as LAS dimensions: 16-bit intensities and colours."""

from dataclasses import replace

import numpy as np

from scanlock.io.scan_file import Field, ScanFile

_MAX = 65535

_COLOURS = ("red", "green", "blue", "nir")
_WHOLE = ("intensity", "user_data", "point_source_id", "classification", "scan_angle")
"""Dimensions of whole numbers that other formats may store as real ones."""


def fitted_to_las(scan: ScanFile) -> ScanFile:
    """Return a scan whose fields fit the dimensions of LAS.

    Colours of 8 bits are scaled to 16. Real-valued fields with the name of an integer dimension
    are renamed, ``intensity`` to ``intensity_float``; ``intensity`` itself is scaled to 16 bits.
    A scan that was read from LAS is returned unchanged.
    """
    if scan.format == "las":
        return scan
    fields: dict[str, Field] = {}
    for name, values in scan.fields.items():
        if name in _COLOURS and values.dtype == np.uint8:
            fields[name] = values.astype(np.uint16) * 257
        elif name in _WHOLE and values.dtype.kind == "f" and values.ndim == 1:
            fields[f"{name}_float"] = values
            if name == "intensity":
                fields[name] = _scaled(values)
        else:
            fields[name] = values
    return replace(scan, fields=fields)


def _scaled(values: Field) -> Field:
    """Return real-valued intensities as 16-bit numbers: those up to 1 as fractions."""
    known = np.nan_to_num(values.astype(np.float64), nan=0.0, posinf=_MAX, neginf=0.0)
    factor = _MAX if known.max(initial=0.0) <= 1.0 else 1.0
    return np.clip(np.round(factor * known), 0, _MAX).astype(np.uint16)
