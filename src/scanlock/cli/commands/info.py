"""``scanlock info``: describe a scan file."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

from scanlock.cli.option_types import Flag
from scanlock.cli.scan_input import Reading

if TYPE_CHECKING:
    from scanlock.cli.console import Facts
    from scanlock.io import ScanDescription

_SHOWN_FIELDS = 24


def info(
    scan: Path,
    /,
    *,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Describe a scan file: format, fields, points and extent, with guesses about the sensor.

    Of a file with several stations, list them.

    Parameters
    ----------
    scan : Path
        The file.
    json : bool
        Print everything as JSON, and nothing else.
    """
    from scanlock.cli.console import print_facts, print_json, print_status, print_title
    from scanlock.io import describe_scan

    how = reading or Reading()
    if _show_stations(scan, how.format, json):
        return
    description = describe_scan(scan, how.format, columns=how.wanted_columns(), scale=how.scale)
    if json:
        print_json(description.as_dict())
        return
    for question in description.questions:
        asked, _, why = question.partition("? ")
        print_status(f"{asked}?", why, good=False)
    print_title(description.path)
    print_facts(_facts(description))
    print_title("guesses")
    print_facts(_guesses(description))


def _show_stations(path: Path, format: str | None, json: bool) -> bool:
    """List the stations of a file that has several; return whether it has."""
    from scanlock.cli.console import print_json, print_line, print_table, print_title
    from scanlock.io.station_files import list_stations

    stations = list_stations(path, format) if path.is_file() else ()
    if len(stations) < 2:
        return False
    if json:
        listed = [
            {"number": k, "name": one.name, "points": one.points}
            for k, one in enumerate(stations, 1)
        ]
        print_json({"path": str(path), "stations": listed})
        return True
    print_title(str(path))
    print_table(
        ["station", "name", "points"],
        [[str(k), one.name, f"{one.points:,}"] for k, one in enumerate(stations, 1)],
    )
    print_line(f"name one to describe it, as in {path}#1")
    return True


def _facts(about: "ScanDescription") -> "Facts":
    organised = f", {about.width:,} columns x {about.height} rows" if about.height > 1 else ""
    encoding = f", {about.encoding}" if about.encoding else ""
    rows: Facts = [
        ("format", f"{about.title}{encoding}, {about.size / 1e6:.2f} MB"),
        *_las(about),
        *_station(about),
        ("points", f"{about.points:,}{organised}"),
        ("dropped", f"{about.not_finite:,} with NaN or Inf, {about.zeros:,} at (0, 0, 0)"),
        ("duplicates", f"{about.duplicates:,}"),
        ("coordinates", about.coordinate_dtype),
        *_extent(about),
        ("fields", _fields(about)),
    ]
    if about.large_coordinates and not about.questions:
        origin = ", ".join(f"{value:.0f}" for value in about.origin)
        rows.append(("origin", f"map coordinates: ({origin}) m is subtracted"))
    if about.ring_field is not None:
        rows.append(("rings", f"{about.rings} in {about.ring_field}"))
    rows.extend(("note", note) for note in about.notes)
    return rows


def _las(about: "ScanDescription") -> "Facts":
    """Return the version of LAS, the steps of the coordinates, and their system and unit."""
    rows: Facts = []
    if about.las is not None:
        las = about.las
        scales, offsets = _numbers(las.scales), _numbers(las.offsets)
        rows.append(("LAS", f"{las.version}, point format {las.point_format}"))
        rows.append(("stored", f"in steps of {scales} from {offsets}"))
    if about.system is None:
        rows += [("system", "no coordinate reference system")] if about.las is not None else []
        return rows
    codes = dict.fromkeys((about.system.epsg, about.system.vertical_epsg))
    named = [about.system.name, *(f"EPSG:{code}" for code in codes if code is not None)]
    rows.append(("system", ", ".join(filter(None, named)) or "unnamed"))
    units = about.system.horizontal_unit, about.system.vertical_unit
    heights = "" if units[0] == units[1] else f", heights in {units[1]}"
    rows.append(("unit", f"{units[0]}{heights}"))
    return rows


def _station(about: "ScanDescription") -> "Facts":
    """Return the name of the station, and its position and rotation in the frame of the file."""
    rows: Facts = [("station", about.station)] if about.station else []
    if about.file_from_station is not None:
        x, y, z = (row[3] for row in about.file_from_station[:3])
        trace = sum(about.file_from_station[k][k] for k in range(3))
        angle = math.degrees(math.acos(min(1.0, max(-1.0, (trace - 1.0) / 2.0))))
        place = f"at ({x:.3f}, {y:.3f}, {z:.3f}) m in the file, rotated by {angle:.2f} deg"
        rows.append(("pose", place))
    return rows


def _numbers(values: tuple[float, float, float]) -> str:
    """Return one number if all three are equal."""
    # Adding zero turns -0.0 into 0.0.
    shown = values[:1] if len(set(values)) == 1 else values
    return ", ".join(f"{value + 0.0:.10g}" for value in shown)


def _extent(about: "ScanDescription") -> "Facts":
    is_geographic = about.system is not None and about.system.is_geographic
    unit, digits = ("deg", 7) if is_geographic else ("m", 3)
    rows: Facts = []
    for axis, low, high in zip("xyz", about.minimum, about.maximum, strict=True):
        if axis == "z":
            unit, digits = "m", 3
        rows.append((axis, f"{low:.{digits}f} to {high:.{digits}f} {unit}"))
    if is_geographic:
        return rows
    sizes = (high - low for low, high in zip(about.minimum, about.maximum, strict=True))
    rows.append(("extent", " x ".join(f"{size:.1f}" for size in sizes) + " m"))
    if not about.large_coordinates:
        ranges = f"{about.median_range:.1f} m median, {about.max_range:.1f} m maximum"
        rows.append(("range", ranges))
    return [*rows, ("spacing", f"{about.spacing:.3f} m to the nearest point, median")]


def _fields(about: "ScanDescription") -> str:
    lines = [
        f"{field.name} {field.dtype}"
        + (f" x {field.values}" if field.values > 1 else "")
        + ("" if field.minimum != field.minimum else f", {field.minimum:g} to {field.maximum:g}")
        for field in about.fields[:_SHOWN_FIELDS]
    ]
    if len(about.fields) > _SHOWN_FIELDS:
        lines.append(f"and {len(about.fields) - _SHOWN_FIELDS} more")
    return "\n".join(lines) or "none but x, y, z"


def _guesses(about: "ScanDescription") -> "Facts":
    guesses = about.guesses
    rows: Facts = [("sensor", guesses.sensor)]
    if guesses.time is not None:
        span = "" if guesses.time.span is None else f", over {guesses.time.span:.4g} s"
        rows.append(("time", f"{about.time_field} in {guesses.time.unit}{span}"))
    return rows
