"""Units of length of coordinate reference systems, by EPSG code and by size."""

from dataclasses import dataclass

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

_VERTICAL = {
    5701: METRE,  # ODN height
    5702: US_SURVEY_FOOT,  # NGVD29 height (ftUS)
    5703: METRE,  # NAVD88 height
    5705: METRE,  # Baltic 1977 height
    5709: METRE,  # NAP height
    5711: METRE,  # AHD height
    5773: METRE,  # EGM96 height
    5783: METRE,  # DHHN92 height
    6360: US_SURVEY_FOOT,  # NAVD88 height (ftUS)
    6647: METRE,  # CGVD2013(CGG2013) height
    7837: METRE,  # DHHN2016 height
    7968: METRE,  # NGVD29 height (m)
    8228: FOOT,  # NAVD88 height (ft)
}
"""Units of vertical systems by EPSG code."""

_UTM = ((32601, 32660), (32701, 32760), (26901, 26923), (25828, 25838))
"""EPSG codes of the zones of UTM (WGS 84, NAD83, ETRS89), which are in metres by definition."""


def unit_of_epsg(code: int | None) -> LengthUnit | None:
    """Return a unit by its EPSG code; None if it is unknown."""
    return None if code is None else _BY_EPSG.get(code)


def unit_of_vertical_system(code: int | None) -> LengthUnit | None:
    """Return the unit of a vertical system by its EPSG code; None if it is unknown."""
    return None if code is None else _VERTICAL.get(code)


def unit_of_projected_system(code: int | None) -> LengthUnit | None:
    """Return the unit of a projected system that is in metres by definition; None otherwise."""
    return METRE if code is not None and any(a <= code <= b for a, b in _UTM) else None


def unit_of_size(metres: float, name: str) -> LengthUnit:
    """Return the known unit of a size [m], or a new one with this name."""
    for unit in _BY_EPSG.values():
        if abs(metres - unit.metres) <= _TOLERANCE * unit.metres:
            return unit
    return LengthUnit(name, metres)
