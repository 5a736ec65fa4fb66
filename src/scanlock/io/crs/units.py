"""Units of length of coordinate reference systems, by EPSG code and by size."""

from collections.abc import Iterator
from dataclasses import dataclass

from scanlock.io.crs.epsg_feet import INTERNATIONAL_FEET, US_SURVEY_FEET

_TOLERANCE = 2e-7
"""Relative tolerance between equal units; files round the US survey foot to 7 digits."""

UNKNOWN = "unknown"
"""Name of a unit that a file does not state."""


@dataclass(frozen=True, slots=True)
class LengthUnit:
    """A unit of length."""

    name: str
    """Name in the EPSG dataset."""

    metres: float
    """Size [m]."""


METRE = LengthUnit("metre", 1.0)
FOOT = LengthUnit("foot", 0.3048)
US_SURVEY_FOOT = LengthUnit("US survey foot", 1200.0 / 3937.0)

_BY_EPSG = {
    9001: METRE,
    9002: FOOT,
    9003: US_SURVEY_FOOT,
    9005: LengthUnit("Clarke's foot", 0.3047972654),
    9036: LengthUnit("kilometre", 1000.0),
    9080: LengthUnit("Indian foot", 0.30479951024814694),
    9094: LengthUnit("Gold Coast foot", 0.3047997101815088),
    1025: LengthUnit("millimetre", 0.001),
    1033: LengthUnit("centimetre", 0.01),
}
"""Units of the EPSG dataset that point clouds use."""

_OTHER_PROJECTED = {
    2066: LengthUnit("Clarke's link", 0.201166195164),
    2136: _BY_EPSG[9094],
    2159: _BY_EPSG[9094],
    2160: _BY_EPSG[9094],
    2314: _BY_EPSG[9005],
    3139: LengthUnit("link", 0.201168),
    3140: LengthUnit("link", 0.201168),
    3407: _BY_EPSG[9005],
    5589: _BY_EPSG[9005],
    22300: _BY_EPSG[9036],
    24100: _BY_EPSG[9005],
    30200: LengthUnit("Clarke's link", 0.201166195164),
}
"""Units of projected systems by EPSG code, beside metres and the two feet."""

_HISTORIC = frozenset(
    {3167, 5472, 24382, 24571, 27291, 27292, 29871, 29872, *range(24370, 24375)}
    | set(range(29371, 29386))
)
"""Projected systems in chains, yards and legal metres, whose units count as unknown."""

_VERTICAL_FEET = {
    **dict.fromkeys((5614, 6130, 6131, 6132, 8050, 8051, 8228, 8897), FOOT),
    **dict.fromkeys((5702, 6358, 6359, 6360, 8052, 8053), US_SURVEY_FOOT),
}
"""Vertical systems in feet by EPSG code, of version 11.022 of the dataset."""

_VERTICAL_CODES = frozenset(range(3855, 32767)) - {5754}
_VERTICAL_DATUMS = range(5001, 5193)
"""Codes of vertical datums and ellipsoids, which GeoTIFF 1.0 has in place of systems."""


def unit_of_epsg(code: int | None) -> LengthUnit | None:
    """Return a unit by its EPSG code; None if it is unknown."""
    return None if code is None else _BY_EPSG.get(code)


def epsg_of_unit(name: str) -> int | None:
    """Return the EPSG code of a unit by its name; None if it is unknown."""
    return next((code for code, unit in _BY_EPSG.items() if unit.name == name), None)


def unit_of_vertical_system(code: int | None) -> LengthUnit | None:
    """Return the unit of a vertical system by its EPSG code; None if it is unknown."""
    if code is None or code not in _VERTICAL_CODES or code in _VERTICAL_DATUMS:
        return None
    return _VERTICAL_FEET.get(code, METRE)


def unit_of_projected_system(code: int | None) -> LengthUnit | None:
    """Return the unit of a projected system by its EPSG code; None if it is unknown.

    Systems that are not in the tables are in metres, as nearly all are.
    """
    if code is None or not 1024 <= code < 32767 or code in _HISTORIC:
        return None
    if code in _OTHER_PROJECTED:
        return _OTHER_PROJECTED[code]
    for unit, table in ((US_SURVEY_FOOT, US_SURVEY_FEET), (FOOT, INTERNATIONAL_FEET)):
        if any(low <= code <= high for low, high in _ranges(table)):
            return unit
    return METRE


def _ranges(table: str) -> Iterator[tuple[int, int]]:
    for entry in table.split():
        low, _, high = entry.partition("-")
        yield int(low), int(high or low)


def unit_of_size(metres: float, name: str) -> LengthUnit:
    """Return the known unit of a size [m], or a new one with this name."""
    for unit in _BY_EPSG.values():
        if abs(metres - unit.metres) <= _TOLERANCE * unit.metres:
            return unit
    return LengthUnit(name, metres)
