"""The coordinate reference system of a scan: EPSG code, name and units."""

from dataclasses import dataclass, replace

from scanlock.errors import InvalidInput, require_positive
from scanlock.io.crs.from_wkt import StatedSystem, system_of_wkt
from scanlock.io.crs.units import (
    METRE,
    UNKNOWN,
    LengthUnit,
    unit_of_projected_system,
    unit_of_vertical_system,
)
from scanlock.io.las_properties import LasRecord


@dataclass(frozen=True, kw_only=True, slots=True)
class CoordinateSystem:
    """Coordinate reference system of a scan, as its file states it.

    Points in memory are metres: the units here are those of files.
    """

    name: str = ""
    """Name, such as ``"NAD83 / UTM zone 12N"``; empty if the file has none."""

    epsg: int | None = None
    """EPSG code of the whole system, or of its horizontal part; None if not stated."""

    vertical_epsg: int | None = None
    """EPSG code of the vertical part; None if not stated."""

    horizontal_unit: str = UNKNOWN
    """Unit of x and y: ``"metre"``, ``"foot"``, ``"US survey foot"``, ``"degree"``, or
    ``"unknown"``, which is read as metres."""

    vertical_unit: str = UNKNOWN
    """Unit of z; ``"unknown"`` is read as metres."""

    metres_per_unit: tuple[float, float, float] = (1.0, 1.0, 1.0)
    """Size of the units of x, y and z [m]; 1 for unknown ones, and for degrees."""

    is_geographic: bool = False
    """Whether x and y are angles (longitude and latitude)."""

    wkt: str = ""
    """Well-known text of the file; empty without one."""

    records: tuple[LasRecord, ...] = ()
    """Records of the LAS file that define the system, written again unchanged."""

    notes: tuple[str, ...] = ()
    """One note for each property that the file does not state, or states twice."""

    @classmethod
    def from_wkt(cls, text: str) -> "CoordinateSystem":
        """Create a system from well-known text, version 1 or 2.

        Parameters
        ----------
        text : str

        Returns
        -------
        CoordinateSystem

        Raises
        ------
        InvalidInput
            Text that cannot be parsed, or that holds no coordinate reference system.
        """
        try:
            stated = system_of_wkt(text)
        except ValueError as error:
            raise InvalidInput(
                f"expected the well-known text of a coordinate reference system, found {error}: "
                f"{text[:60]!r}"
            ) from error
        return replace(system_from_statements(stated), wkt=text.rstrip("\0"))

    @property
    def label(self) -> str:
        """Name and EPSG codes, for messages."""
        codes = [self.epsg, self.vertical_epsg if self.vertical_epsg != self.epsg else None]
        text = " + ".join(f"EPSG:{code}" for code in codes if code is not None)
        if self.name and text:
            return f"{self.name} ({text})"
        return self.name or text or "unnamed system"

    @property
    def unit_text(self) -> str:
        """Units of x, y and of z, for messages."""
        horizontal = _described(self.horizontal_unit, self.metres_per_unit[0], self.is_geographic)
        vertical = _described(self.vertical_unit, self.metres_per_unit[2], False)
        return horizontal if horizontal == vertical else f"{horizontal}, heights in {vertical}"

    def with_unit(self, metres: float) -> "CoordinateSystem":
        """Return the system with another unit of x, y and z, in place of the stated one.

        Parameters
        ----------
        metres : float [m]
            Size of the unit.

        Returns
        -------
        CoordinateSystem

        Raises
        ------
        InvalidInput
            A size that is not positive, or a system of longitude and latitude.
        """
        require_positive("scale", metres)
        if self.is_geographic:
            raise InvalidInput(
                f"scale must not be given for degrees ({self.label}), got {metres:g}; project the "
                "coordinates first"
            )
        unit = f"unit of {metres:g} m"
        return replace(
            self, horizontal_unit=unit, vertical_unit=unit, metres_per_unit=(metres,) * 3, notes=()
        )

    def require_lengths(self, name: str) -> None:
        """Raise `InvalidInput` if x and y are angles, which cannot be registered.

        Parameters
        ----------
        name : str
            Name of the scan, for the message.
        """
        if self.is_geographic:
            raise InvalidInput(
                f"{name}: expected lengths, found longitude and latitude in "
                f"{self.horizontal_unit}s ({self.label}); project the file to metres first: pdal "
                "translate in.las out.las reprojection --filters.reprojection.out_srs=EPSG:CODE, "
                "for example 32633 for UTM zone 33N"
            )


def system_from_statements(stated: StatedSystem) -> CoordinateSystem:
    """Create a system from what a file states.

    Units that the file does not state are those of its EPSG codes. Without a code, they are read as
    metres, and heights in the unit of x and y. Each of these is noted.
    """
    notes: list[str] = []
    horizontal = _unit(
        stated.horizontal,
        unit_of_projected_system(stated.projected_epsg),
        ("x and y", stated.projected_epsg),
        notes,
    )
    vertical = _unit(
        stated.vertical,
        unit_of_vertical_system(stated.vertical_epsg),
        ("heights", stated.vertical_epsg),
        notes,
    )
    if horizontal is None and not stated.is_geographic:
        notes.append("the file does not state the unit: taken as metres; --scale 0.3048 reads feet")
    if vertical is None and horizontal is not None and not stated.is_geographic:
        vertical = horizontal
        if horizontal is not METRE:
            notes.append(
                f"the file does not state the unit of heights: taken as {horizontal.name}, as "
                "for x and y"
            )
    sizes = [_size(horizontal), _size(horizontal), _size(vertical)]
    return CoordinateSystem(
        name=stated.name,
        epsg=stated.epsg,
        vertical_epsg=stated.vertical_epsg,
        horizontal_unit=stated.angle_unit or "degree"
        if stated.is_geographic
        else _unit_name(horizontal),
        vertical_unit=_unit_name(vertical),
        metres_per_unit=(sizes[0], sizes[1], sizes[2]),
        is_geographic=stated.is_geographic,
        notes=tuple(notes),
    )


def unit_notes(crs: CoordinateSystem) -> tuple[str, ...]:
    """Return the notes of a system, and on its unit unless that is the metre."""
    if crs.is_geographic:
        return (*crs.notes, f"x and y are longitude and latitude in {crs.horizontal_unit}s")
    if crs.metres_per_unit == (1.0, 1.0, 1.0):
        return crs.notes
    if crs.metres_per_unit[:2] == (1.0, 1.0):
        return (*crs.notes, f"heights converted to metres from {crs.vertical_unit}")
    return (*crs.notes, f"converted to metres from {crs.unit_text}")


def _unit(
    stated: LengthUnit | None,
    by_code: LengthUnit | None,
    subject: tuple[str, int | None],
    notes: list[str],
) -> LengthUnit | None:
    """Return the stated unit, else that of the EPSG code, and note where the file is unclear."""
    axes, code = subject
    if stated is None:
        if by_code is not None and by_code is not METRE:
            notes.append(f"the file does not state the unit of {axes}: that of EPSG:{code} is used")
        return by_code
    if by_code is not None and stated != by_code:
        notes.append(
            f"the file states {stated.name} for {axes} (used), but EPSG:{code} is in {by_code.name}"
        )
    return stated


def _size(unit: LengthUnit | None) -> float:
    return 1.0 if unit is None else unit.metres


def _unit_name(unit: LengthUnit | None) -> str:
    return UNKNOWN if unit is None else unit.name


def _described(name: str, metres: float, is_angle: bool) -> str:
    if name == UNKNOWN:
        return "unknown unit, read as metres"
    return (
        name
        if is_angle or metres == 1.0 or name.startswith("unit of")
        else (f"{name} ({metres:.7g} m)")
    )
