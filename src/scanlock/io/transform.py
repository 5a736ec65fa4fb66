"""Scans in another frame, and several scans as one, with all their fields."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from scanlock.arrays import Mask
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.io.scan_file import Field, ScanFile

_NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))
"""Names of three fields with the components of a normal."""

_NORMAL_VECTORS = ("normals", "normal")
"""Names of an (n, 3) field of normals."""

_COLOURS = ("red", "green", "blue")

_PALETTE = np.array(
    [
        (0, 114, 178),
        (213, 94, 0),
        (0, 158, 115),
        (204, 121, 167),
        (86, 180, 233),
        (230, 159, 0),
    ],
    np.uint8,
)
"""Colours of scans in turn, for all common kinds of colour vision (Okabe and Ito)."""


def transform_scan(scan: ScanFile, pose: Pose) -> ScanFile:
    """Transform the points, the normals and the viewpoint of a scan; keep all other fields.

    Parameters
    ----------
    scan : ScanFile
    pose : Pose
        New frame from that of the scan, such as ``result.target_from_source``.

    Returns
    -------
    ScanFile
        With the same rows. A row at (0, 0, 0), where the sensor had no return, becomes NaN. The
        points are no longer in the frame of a station, so that `file_from_station` is None.
    """
    blank = is_blank(scan)
    points = pose.apply(scan.points)
    points[blank] = np.nan
    fields = dict(scan.fields)
    for names in _NORMALS:
        if set(names) <= set(fields):
            normals = np.stack([fields[name] for name in names], axis=1) @ pose.rotation.T
            for name, column in zip(names, normals.T, strict=True):
                fields[name] = column.astype(fields[name].dtype)
    for name in _NORMAL_VECTORS:
        if name in fields and fields[name].shape == (len(scan), 3):
            fields[name] = (fields[name] @ pose.rotation.T).astype(fields[name].dtype)
    viewpoint = None if scan.viewpoint is None else pose @ scan.viewpoint
    return replace(scan, points=points, fields=fields, viewpoint=viewpoint, file_from_station=None)


def merge_scans(scans: Sequence[ScanFile], *, colours: bool = True) -> ScanFile:
    """Merge scans that are in one frame into one, with a field for the number of the scan.

    Parameters
    ----------
    scans : sequence of ScanFile
        The first gives the coordinate system and format.
    colours : bool
        Whether to give each scan a colour, for viewers, if none has colours of its own.

    Returns
    -------
    ScanFile
        The rows of all scans with a return, in order. `fields` are those of any scan, NaN or zero
        for scans without it, and ``scan``: 0 for the first scan, 1 for the second, ...

    Raises
    ------
    InvalidInput
        No scans, stations in frames of their own, or fields of one name with different widths.
    """
    if not scans:
        raise InvalidInput("scans must hold at least one scan, got none")
    if len({scan.file_from_station for scan in scans} - {None}) > 1:
        raise InvalidInput(
            "scans must be in one frame, got stations with different poses in their file; move "
            "each with transform_scan(scan, scan.file_from_station) first"
        )
    scans = [keep_rows(scan, has_return(scan)) for scan in scans]
    fields = {name: _joined(name, scans) for name in _field_names(scans)}
    counts = [len(scan) for scan in scans]
    numbers = np.repeat(np.arange(len(scans)), counts).astype(np.uint16)
    fields[_free_name("scan", fields)] = numbers
    if colours and not has_colours(fields):
        fields.update(zip(_COLOURS, _PALETTE[numbers % len(_PALETTE)].T, strict=True))
    return replace(
        scans[0],
        points=np.concatenate([scan.points for scan in scans]),
        fields=fields,
        width=sum(counts),
        height=1,
        viewpoint=None,
        station="",
        file_from_station=None,
        coordinate_dtype=_wider(scan.coordinate_dtype for scan in scans),
        notes=(),
    )


def is_blank(scan: ScanFile) -> Mask:
    """Return (n,) whether each row is (0, 0, 0), which drivers write for beams without a return."""
    return (scan.points == 0.0).all(axis=1)


def has_return(scan: ScanFile) -> Mask:
    """Return (n,) whether each row is a point: finite and not blank."""
    return np.isfinite(scan.points).all(axis=1) & ~is_blank(scan)


def keep_rows(scan: ScanFile, rows: Mask) -> ScanFile:
    """Return the rows of a mask (n,), as an unorganised scan unless all are kept.

    Raises
    ------
    InvalidInput
        No row is kept.
    """
    if rows.all():
        return scan
    if not rows.any():
        raise InvalidInput("a scan must keep at least one row with a return, got none")
    return replace(
        scan,
        points=scan.points[rows],
        fields={name: values[rows] for name, values in scan.fields.items()},
        width=int(rows.sum()),
        height=1,
    )


def has_colours(fields: Mapping[str, Any]) -> bool:
    """Return whether fields hold colours: red, green and blue, or packed as rgb or rgba."""
    return set(_COLOURS) <= set(fields) or bool({"rgb", "rgba"} & set(fields))


def _field_names(scans: Sequence[ScanFile]) -> list[str]:
    return list(dict.fromkeys(name for scan in scans for name in scan.fields))


def _joined(name: str, scans: Sequence[ScanFile]) -> Field:
    """Return a field of all scans, NaN or zero for scans without it."""
    known = [scan.fields[name] for scan in scans if name in scan.fields]
    shapes = {values.shape[1:] for values in known}
    if len(shapes) > 1:
        raise InvalidInput(f"field {name} must have one width in all scans, got {sorted(shapes)}")
    kind = np.result_type(*(values.dtype for values in known))
    missing = np.nan if kind.kind == "f" else 0
    parts = [
        scan.fields[name].astype(kind)
        if name in scan.fields
        else np.full((len(scan), *next(iter(shapes))), missing, kind)
        for scan in scans
    ]
    return np.concatenate(parts)


def _free_name(name: str, fields: Mapping[str, Any]) -> str:
    candidate, number = name, 2
    while candidate in fields:
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def _wider(kinds: Iterable[str]) -> str:
    kinds = list(kinds)
    return kinds[0] if len(set(kinds)) == 1 else "float64"
