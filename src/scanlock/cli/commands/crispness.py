"""``scanlock crispness``: how many voxels a map fills."""

from pathlib import Path

from scanlock.cli.option_types import Flag
from scanlock.cli.scan_input import Reading


def crispness(
    map: Path,
    /,
    *more: Path,
    width: float = 0.1,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Count the voxels that maps of the same scans fill: the fewer, the crisper.

    Parameters
    ----------
    map : Path
        The file of a map, all points in one frame.
    more : Path
        Further maps to compare it with.
    width : float
        Side of the voxels [m].
    json : bool
        Print the counts as JSON, and nothing else.
    """
    from scanlock.cli.console import print_json, print_table
    from scanlock.clouds.point_cloud import PointCloud
    from scanlock.evaluation.crispness import crispness as counted

    rows: list[dict[str, str | int | float]] = []
    origin = None
    for path in (map, *more):
        cloud = PointCloud.from_array((reading or Reading()).load(path).returns)
        # In map coordinates, voxels have a corner at the first map's origin: one grid for all.
        origin = cloud.origin if origin is None else origin
        shift = cloud.origin - origin
        voxels = counted(cloud.points + shift if shift.any() else cloud.points, width)
        rows.append({"map": str(path), "points": len(cloud), "voxels": voxels, "width_m": width})
    if json:
        print_json({"maps": rows})
        return
    print_table(
        ("voxels filled", "of [m]", "points", "map"),
        [
            (f"{row['voxels']:,}", f"{width:g}", f"{row['points']:,}", str(row["map"]))
            for row in rows
        ],
    )
