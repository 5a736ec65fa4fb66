"""Selection of the properties of a LAS file that a scan keeps."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from scanlock.io.formats.las.records import defines_system
from scanlock.io.las_properties import ExtraDimension, LasProperties, LasRecord, Triple

_DROPPED = {
    ("copc", 1): "COPC",
    ("copc", 1000): "COPC",
    ("copc", 10000): "COPC",
    ("LAStools", 30): "LAStools",
    ("LASF_Spec", 65535): "waveform packets",
}
"""Indices of points in the file, and data outside the points, which a new file invalidates."""

_DROP_NOTES = {
    "COPC": "the COPC index is not kept: the scan is written again as plain LAS or LAZ",
    "LAStools": "the spatial index of LAStools is not kept: lasindex makes a new one",
    "waveform packets": "waveform packets are not kept",
}

_REBUILT = {("laszip encoded", 22204), ("LASF_Spec", 4)}
"""Records that describe compression and extra dimensions; the writer makes new ones."""

_WAVEFORM_BITS = 0b0110
"""Bits of the global encoding: waveform packets in the file or in another one."""


def properties_of(header: Any, records: Sequence[LasRecord]) -> tuple[LasProperties, list[str]]:
    """Return the properties of a LAS file to keep, and notes on those that are not kept.

    Parameters
    ----------
    header : laspy.LasHeader
    records : sequence of LasRecord
        All records of the file.
    """
    kept: list[LasRecord] = []
    dropped: list[str] = []
    for record in records:
        key = (record.user_id, record.record_id)
        if key in _DROPPED:
            dropped.append(_DROPPED[key])
        elif key not in _REBUILT and not defines_system(record):
            kept.append(record)
    return LasProperties(
        version=str(header.version),
        point_format=int(header.point_format.id),
        scales=_triple(header.scales),
        offsets=_triple(header.offsets),
        system_id=_text(header.system_identifier),
        software=_text(header.generating_software),
        global_encoding=int(header.global_encoding.value) & ~_WAVEFORM_BITS,
        file_source_id=int(header.file_source_id),
        project_id=header.uuid.bytes_le,
        extra_dimensions=tuple(map(_extra_dimension, header.point_format.extra_dimensions)),
        records=tuple(kept),
    ), [_DROP_NOTES[name] for name in dict.fromkeys(dropped)]


def _extra_dimension(dimension: Any) -> ExtraDimension:
    return ExtraDimension(
        name=dimension.name,
        dtype=np.dtype(dimension.dtype).base.str if dimension.dtype is not None else "<u1",
        elements=int(dimension.num_elements),
        description=_text(dimension.description),
        scales=_numbers(dimension.scales),
        offsets=_numbers(dimension.offsets),
        no_data=_numbers(dimension.no_data),
    )


def _numbers(values: Any) -> tuple[float, ...] | None:
    return None if values is None else tuple(np.asarray(values).tolist())


def _triple(values: Any) -> Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z


def _text(value: str | bytes) -> str:
    text = value.decode("latin-1") if isinstance(value, bytes) else value
    return text.rstrip("\0")
