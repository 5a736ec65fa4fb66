"""``scanlock crispness``: how many voxels a map fills."""

from pathlib import Path

from scanlock.cli.choices import Flag
from scanlock.cli.reading import Reading


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
    from scanlock.cli.screen import print_json, print_table
    from scanlock.clouds.point_cloud import PointCloud
    from scanlock.evaluation.crispness import crispness as counted

    rows: list[dict[str, str | int | float]] = []
    for path in (map, *more):
        points = (reading or Reading()).load(path).returns
        # Far from zero the voxels are those of the map less its origin, whole metres of it.
        cloud = PointCloud.from_array(points)
        voxels = counted(cloud.points, width)
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
