"""Dimensions of LAS points: standard and extra ones."""

from pathlib import Path
from typing import Any

import numpy as np

from scanlock.errors import InvalidInput
from scanlock.io.las_properties import ExtraDimension, LasProperties
from scanlock.io.scan_file import Field

COORDINATES = frozenset({"X", "Y", "Z", "x", "y", "z"})
"""Names of dimensions that are not fields."""

_MAX_NAME_SIZE = 32


def add_dimensions(
    laspy: Any, path: Path, header: Any, kept: LasProperties, fields: dict[str, Field]
) -> None:
    """Add an extra dimension to a header for each field that its point format lacks.

    Raises
    ------
    InvalidInput
        A field with a name or type that LAS cannot hold.
    """
    known = set(header.point_format.dimension_names) - COORDINATES
    described = {one.name: one for one in kept.extra_dimensions}
    parameters: list[Any] = []
    for name, values in fields.items():
        if name in known:
            continue
        _require_extra_dimension(path, name, values)
        parameters.append(_parameters(laspy, name, values, described.get(name)))
    header.add_extra_dims(parameters)


def _parameters(laspy: Any, name: str, values: Field, old: ExtraDimension | None) -> Any:
    dtype = values.dtype.newbyteorder("=")
    kind: Any = np.dtype(np.uint8) if dtype.kind == "b" else dtype
    if old is None or old.elements != (1 if values.ndim == 1 else values.shape[1]):
        return laspy.ExtraBytesParams(name=name, type=kind)
    # A scaled dimension is read as float64, and stored as integers again.
    is_scaled = old.scales is not None or old.offsets is not None
    base = np.dtype(old.dtype) if is_scaled and dtype == np.float64 else kind
    is_same = is_scaled or base == np.dtype(old.dtype)
    return laspy.ExtraBytesParams(
        name=name,
        type=base if old.elements == 1 else np.dtype((base, (old.elements,))),
        description=old.description,
        scales=old.scales if is_same else None,
        offsets=old.offsets if is_same else None,
        no_data=old.no_data if is_same else None,
    )


def fill_dimension(path: Path, las: Any, name: str, values: Field) -> None:
    """Store a field in its dimension.

    Raises
    ------
    InvalidInput
        Values that the dimension cannot hold without loss.
    """
    try:
        las[name] = values
        is_equal = _holds(las.point_format.dimension_by_name(name), np.array(las[name]), values)
    except (OverflowError, ValueError, TypeError):
        is_equal = False
    if not is_equal:
        raise InvalidInput(
            f"{path}: the LAS dimension {name} cannot hold these {values.dtype} values "
            f"({values.min()} to {values.max()}); rename the field to store it as an extra one"
        )


def _holds(dimension: Any, stored: Field, values: Field) -> bool:
    """Return whether the stored values are the given ones, up to the step of a scaled dimension."""
    if dimension.scales is not None:
        step = np.asarray(dimension.scales) * (0.5 + 1e-6)
        return bool((np.abs(stored - values) <= step).all())
    return np.array_equal(stored, values, equal_nan=values.dtype.kind == "f")


def _require_extra_dimension(path: Path, name: str, values: Field) -> None:
    if (
        values.dtype.kind not in "biuf"
        or values.dtype.itemsize not in (1, 2, 4, 8)
        or (values.dtype.kind == "f" and values.dtype.itemsize == 2)
    ):
        raise InvalidInput(f"{path}: LAS cannot hold field {name} of type {values.dtype}")
    if name in COORDINATES or not 0 < len(name.encode()) <= _MAX_NAME_SIZE:
        raise InvalidInput(
            f"{path}: a field name of LAS must have 1 to {_MAX_NAME_SIZE} bytes and not be x, y or "
            f"z, got {name!r}; rename it"
        )
