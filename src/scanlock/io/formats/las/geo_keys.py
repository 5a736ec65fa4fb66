"""GeoTIFF keys of LAS files (OGC 19-008): the coordinate reference system that they state."""

import math
import struct
from dataclasses import dataclass

from scanlock.io.crs.coordinate_system import CoordinateSystem
from scanlock.io.crs.from_wkt import StatedSystem
from scanlock.io.crs.units import (
    LengthUnit,
    epsg_of_unit,
    unit_of_epsg,
    unit_of_size,
)

_MODEL_TYPE, _CITATION = 1024, 1026
_GEODETIC_SYSTEM, _GEODETIC_CITATION, _ANGLE_UNIT = 2048, 2049, 2054
_PROJECTED_SYSTEM, _PROJECTED_CITATION = 3072, 3073
_LENGTH_UNIT, _LENGTH_UNIT_SIZE = 3076, 3077
_VERTICAL_SYSTEM, _VERTICAL_CITATION, _VERTICAL_UNIT = 4096, 4097, 4099

_PROJECTED_MODEL, _GEOGRAPHIC_MODEL = 1, 2
_USER_DEFINED = 32767
_DOUBLES, _STRINGS = 34736, 34737
_ANGLES = {9101: "radian", 9102: "degree", 9105: "grad"}


@dataclass(frozen=True, slots=True)
class _GeoKeys:
    numbers: dict[int, int]
    sizes: dict[int, float]
    texts: dict[int, str]

    def code(self, key: int) -> int | None:
        """Return an EPSG code; None where it is missing, undefined (0) or user-defined."""
        value = self.numbers.get(key)
        return value if value not in (0, _USER_DEFINED) else None

    def length(self, key: int) -> LengthUnit | None:
        return unit_of_epsg(self.code(key))


def system_of_geo_keys(directory: bytes, doubles: bytes, strings: bytes) -> StatedSystem | None:
    """Return the properties that GeoTIFF keys state; None without any key.

    Parameters
    ----------
    directory, doubles, strings : bytes
        Contents of the records 34735, 34736 and 34737; empty without one.
    """
    keys = _parsed(directory, doubles, strings)
    if not (keys.numbers or keys.texts):
        return None
    projected = keys.code(_PROJECTED_SYSTEM)
    is_geographic = _PROJECTED_SYSTEM not in keys.numbers and (
        keys.numbers[_MODEL_TYPE] == _GEOGRAPHIC_MODEL
        if _MODEL_TYPE in keys.numbers
        else _GEODETIC_SYSTEM in keys.numbers
    )
    size = keys.sizes.get(_LENGTH_UNIT_SIZE)
    length = keys.length(_LENGTH_UNIT)
    if length is None and size is not None and 0.0 < size < math.inf:
        length = unit_of_size(size, "user-defined unit")
    citations = (_GEODETIC_CITATION,) if is_geographic else (_PROJECTED_CITATION, _CITATION)
    return StatedSystem(
        name=next((keys.texts[key] for key in citations if keys.texts.get(key)), ""),
        epsg=keys.code(_GEODETIC_SYSTEM) if is_geographic else projected,
        projected_epsg=projected,
        vertical_epsg=keys.code(_VERTICAL_SYSTEM),
        is_geographic=is_geographic,
        angle_unit=_ANGLES.get(keys.numbers.get(_ANGLE_UNIT, 0)) if is_geographic else None,
        horizontal=None if is_geographic else length,
        vertical=keys.length(_VERTICAL_UNIT),
    )


def directory_of_system(crs: CoordinateSystem) -> bytes:
    """Return the directory of the keys that state a system by EPSG codes; empty without a code."""
    if crs.epsg is None:
        return b""
    keys = {
        _MODEL_TYPE: _GEOGRAPHIC_MODEL if crs.is_geographic else _PROJECTED_MODEL,
        _GEODETIC_SYSTEM if crs.is_geographic else _PROJECTED_SYSTEM: crs.epsg,
        _LENGTH_UNIT: None if crs.is_geographic else epsg_of_unit(crs.horizontal_unit),
        _VERTICAL_SYSTEM: crs.vertical_epsg,
        _VERTICAL_UNIT: epsg_of_unit(crs.vertical_unit),
    }
    rows = [(key, 0, 1, value) for key, value in sorted(keys.items()) if value is not None]
    return b"".join(struct.pack("<4H", *row) for row in [(1, 1, 0, len(rows)), *rows])


def _parsed(directory: bytes, doubles: bytes, strings: bytes) -> _GeoKeys:
    keys = _GeoKeys({}, {}, {})
    # The directory begins with its version and the number of keys, as one more row.
    for number, location, count, value in list(struct.iter_unpack("<4H", _rows(directory)))[1:]:
        if location == 0:
            keys.numbers.setdefault(number, value)
        elif location == _DOUBLES and 8 * value + 8 <= len(doubles):
            keys.sizes[number] = struct.unpack_from("<d", doubles, 8 * value)[0]
        elif location == _STRINGS:
            text = strings[value : value + count].decode("utf-8", errors="replace")
            keys.texts[number] = text.rstrip("|\0 ")
    return keys


def _rows(directory: bytes) -> bytes:
    return directory[: len(directory) // 8 * 8]
