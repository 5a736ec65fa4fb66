"""``scanlock info``: describe a scan file."""

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

    Parameters
    ----------
    scan : Path
        The file.
    json : bool
        Print everything as JSON, and nothing else.
    """
    from scanlock.cli.console import print_facts, print_json, print_title
    from scanlock.io import describe_scan

    how = reading or Reading()
    description = describe_scan(scan, how.format, columns=how.wanted_columns())
    if json:
        print_json(description.as_dict())
        return
    print_title(description.path)
    print_facts(_facts(description))
    print_title("guesses")
    print_facts(_guesses(description))


def _facts(about: "ScanDescription") -> "Facts":
    organised = f", {about.width:,} columns x {about.height} rows" if about.height > 1 else ""
    encoding = f", {about.encoding}" if about.encoding else ""
    rows: Facts = [
        ("format", f"{about.title}{encoding}, {about.size / 1e6:.2f} MB"),
        ("points", f"{about.points:,}{organised}"),
        ("dropped", f"{about.not_finite:,} with NaN or Inf, {about.zeros:,} at (0, 0, 0)"),
        ("duplicates", f"{about.duplicates:,}"),
        ("coordinates", about.coordinate_dtype),
        *(
            (axis, f"{low:.3f} to {high:.3f} m")
            for axis, low, high in zip("xyz", about.minimum, about.maximum, strict=True)
        ),
        ("range", f"{about.median_range:.1f} m median, {about.max_range:.1f} m maximum"),
        ("spacing", f"{about.spacing:.3f} m to the nearest point, median"),
        ("fields", _fields(about)),
    ]
    if about.large_coordinates:
        origin = ", ".join(f"{value:.0f}" for value in about.origin)
        rows.append(("origin", f"map coordinates: ({origin}) m is subtracted"))
    if about.ring_field is not None:
        rows.append(("rings", f"{about.rings} in {about.ring_field}"))
    rows.extend(("note", note) for note in about.notes)
    return rows


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
    from scanlock.registration.registry import METHODS

    guesses = about.guesses
    rows: Facts = [("sensor", guesses.sensor)]
    if guesses.time is not None:
        span = "" if guesses.time.span is None else f", over {guesses.time.span:.4g} s"
        rows.append(("time", f"{about.time_field} in {guesses.time.unit}{span}"))
    rows.append(("max range", f"{guesses.settings.max_range:g} m"))
    rows.append(("voxel size", f"{guesses.settings.voxel_size:g} m"))
    if guesses.settings.method in METHODS:
        rows.append(("method", guesses.settings.method))
    return rows
