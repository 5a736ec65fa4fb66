"""Properties of a coordinate reference system by its well-known text."""

import math
from dataclasses import dataclass

from scanlock.io.crs.units import (
    METRE,
    LengthUnit,
    unit_of_epsg,
    unit_of_size,
)
from scanlock.io.crs.wkt import WktNode, parse_wkt

_COMPOUND = ("COMPD_CS", "COMPOUNDCRS")
_PROJECTED = ("PROJCS", "PROJCRS", "PROJECTEDCRS", "DERIVEDPROJCRS")
_GEOGRAPHIC = ("GEOGCS", "GEOGCRS", "GEOGRAPHICCRS")
_GEODETIC = ("GEODCRS", "GEODETICCRS")
_OTHER = ("GEOCCS", "LOCAL_CS", "ENGCRS", "ENGINEERINGCRS")
_VERTICAL = ("VERT_CS", "VERTCS", "VERTCRS", "VERTICALCRS")
_UNITS = ("UNIT", "LENGTHUNIT", "ANGLEUNIT")


@dataclass(frozen=True, kw_only=True, slots=True)
class StatedSystem:
    """Properties that a file states of its coordinate reference system; None where it does not."""

    name: str = ""
    epsg: int | None = None
    projected_epsg: int | None = None
    vertical_epsg: int | None = None
    is_geographic: bool = False
    angle_unit: str | None = None
    horizontal: LengthUnit | None = None
    vertical: LengthUnit | None = None


def system_of_wkt(text: str) -> StatedSystem:
    """Return the properties that well-known text states.

    Raises
    ------
    ValueError
        Text that cannot be parsed, or that holds no coordinate reference system.
    """
    roots = parse_wkt(text)
    horizontal = _first(roots, *_PROJECTED, *_GEOGRAPHIC, *_GEODETIC, *_OTHER)
    vertical = _first(roots, *_VERTICAL)
    whole = _first(roots, *_COMPOUND) or horizontal or vertical
    if whole is None:
        raise ValueError(f"no coordinate reference system, but {roots[0].keyword}")
    code = None if horizontal is None else _epsg(horizontal)
    vertical_code = None if vertical is None else _epsg(vertical)
    is_geographic = horizontal is not None and _is_geographic(horizontal)
    angle = None
    length = None
    if horizontal is not None and is_geographic:
        unit = _unit_node(horizontal)
        angle = "degree" if unit is None else _angle_name(unit)
    elif horizontal is not None:
        length = _length(_unit_node(horizontal))
    height = None
    if vertical is not None:
        height = _length(_unit_node(vertical))
    elif horizontal is not None:
        height = _third_axis(horizontal)
    return StatedSystem(
        name=whole.name,
        epsg=_epsg(whole) or code,
        projected_epsg=None if is_geographic or horizontal is None else code,
        vertical_epsg=vertical_code,
        is_geographic=is_geographic,
        angle_unit=angle,
        horizontal=length,
        vertical=height,
    )


def _first(roots: tuple[WktNode, ...], *keywords: str) -> WktNode | None:
    return next((node for root in roots for node in root.search(*keywords)), None)


def _is_geographic(node: WktNode) -> bool:
    if node.keyword in _GEODETIC:
        system = node.child("CS")
        return system is None or system.name.lower() == "ellipsoidal"
    return node.keyword in _GEOGRAPHIC


def _epsg(node: WktNode) -> int | None:
    identifier = node.child("AUTHORITY", "ID")
    if identifier is None or len(identifier.values) < 2:
        return None
    authority, code = identifier.values[:2]
    return int(code) if authority.upper() == "EPSG" and code.isdecimal() else None


def _unit_node(node: WktNode) -> WktNode | None:
    """Return the unit of a system; version 2 may state it at the first axis instead."""
    unit = node.child(*_UNITS)
    axis = node.child("AXIS")
    return axis.child(*_UNITS) if unit is None and axis is not None else unit


def _third_axis(node: WktNode) -> LengthUnit | None:
    axes = [child for child in node.children if child.keyword == "AXIS"]
    if len(axes) < 3:
        return None
    unit = axes[2].child("LENGTHUNIT", "UNIT")
    if unit is None and node.keyword not in _GEOGRAPHIC:
        unit = _unit_node(node)
    return _length(unit)


def _length(unit: WktNode | None) -> LengthUnit | None:
    if unit is None or len(unit.values) < 2:
        return METRE if unit is not None and unit.name.lower() in ("metre", "meter") else None
    try:
        metres = float(unit.values[1])
    except ValueError:
        return unit_of_epsg(_epsg(unit))
    return unit_of_size(metres, unit.name) if 0.0 < metres < math.inf else None


def _angle_name(unit: WktNode) -> str:
    return unit.name.lower() or "degree"
