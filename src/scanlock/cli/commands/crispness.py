"""``scanlock crispness``: count the voxels that a map fills."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scanlock.cli.mapping.scans import NUMBER
from scanlock.cli.option_types import Flag
from scanlock.cli.scan_input import Reading
from scanlock.errors import InvalidInput, require_count, require_positive

if TYPE_CHECKING:
    from scanlock.arrays import Vector

_MAX_DIFFERENCE = 0.1
"""Maximum difference of the numbers of scans and of the extents of maps of the same scans."""

_TAIL = 1.0
"""Percentage of the points on either side that the extent leaves out."""


@dataclass(frozen=True, slots=True)
class _Counted:
    path: Path
    points: int
    voxels: int
    extent: "Vector"
    """(3,) size of the box around the points, without outliers [m]."""
    scans: int | None
    """Number of scans, if the map has a field for it."""


def crispness(
    map: Path,
    /,
    *more: Path,
    voxel_size: float = 0.1,
    threads: int = 1,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Count the voxels that maps of the same scans fill; fewer is crisper.

    Parameters
    ----------
    map : Path
        Map file, all points in one frame.
    more : Path
        More maps to compare, of the same scans.
    voxel_size : float
        Voxel size [m].
    threads : int
        Maximum number of maps that are read and counted at once.
    json : bool
        Print the counts as JSON, and nothing else.
    """
    from scanlock.cli.console import print_json, print_line, print_table
    from scanlock.threads import parallel_map, using_threads

    require_count("--threads", threads)
    require_positive("--voxel-size", voxel_size, unit="m")
    reading = reading or Reading()
    origin, first = _counted(map, voxel_size, reading, None)
    with using_threads(threads):
        # In map coordinates all maps use one grid, with a corner at the origin of the first.
        rest = parallel_map(lambda path: _counted(path, voxel_size, reading, origin)[1], more)
    counted = [first, *rest]
    _require_same_scans(counted)
    notes = _different_extents(counted)
    if json:
        print_json({"maps": [_content(one, voxel_size) for one in counted], "notes": notes})
        return
    print_table(
        ("voxels filled", "of [m]", "points", "map"),
        [
            (f"{one.voxels:,}", f"{voxel_size:g}", f"{one.points:,}", str(one.path))
            for one in counted
        ],
    )
    for note in notes:
        print_line(f"note: {note}")


def _counted(
    path: Path, voxel_size: float, reading: Reading, origin: "Vector | None"
) -> "tuple[Vector, _Counted]":
    """Count the voxels of one map about an origin, by default its own; return the origin too."""
    import numpy as np

    from scanlock.clouds.point_cloud import PointCloud
    from scanlock.evaluation.crispness import crispness as counted

    loaded = reading.load(path)
    cloud = PointCloud.from_array(loaded.returns)
    origin = cloud.origin if origin is None else origin
    shift = cloud.origin - origin
    voxels = counted(cloud.points + shift if shift.any() else cloud.points, voxel_size)
    low, high = np.percentile(cloud.points, [_TAIL, 100.0 - _TAIL], axis=0)
    numbers = loaded.file.fields.get(NUMBER)
    scans = None if numbers is None else len(np.unique(numbers))
    return origin, _Counted(path, len(cloud), voxels, high - low, scans)


def _require_same_scans(maps: Sequence[_Counted]) -> None:
    """Raise `InvalidInput` if the fields of the maps show different numbers of scans."""
    known = [one for one in maps if one.scans is not None]
    for one in known[1:]:
        fewer, more = sorted((one.scans or 0, known[0].scans or 0))
        if fewer < (1.0 - _MAX_DIFFERENCE) * more:
            raise InvalidInput(
                f"only maps of the same scans are comparable, got {known[0].scans} scans in "
                f"{known[0].path} and {one.scans} in {one.path}"
            )


def _different_extents(maps: Sequence[_Counted]) -> list[str]:
    """Return a note for each map that is larger or smaller than the first."""
    first = maps[0]
    return [
        f"{one.path} extends over {_metres(one.extent)}, {first.path} over "
        f"{_metres(first.extent)}; only maps of the same scans are comparable"
        for one in maps[1:]
        if (abs(one.extent - first.extent) > 1.0 + _MAX_DIFFERENCE * first.extent).any()
    ]


def _metres(extent: "Vector") -> str:
    return " x ".join(f"{side:.0f}" for side in extent) + " m"


def _content(one: _Counted, voxel_size: float) -> dict[str, Any]:
    return {
        "map": str(one.path),
        "points": one.points,
        "voxels": one.voxels,
        "voxel_size_m": voxel_size,
    }
