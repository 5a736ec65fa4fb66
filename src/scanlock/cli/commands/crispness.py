"""``scanlock crispness``: count the voxels that a map fills."""

from pathlib import Path

from scanlock.cli.option_types import Flag
from scanlock.cli.scan_input import Reading


def crispness(
    map: Path,
    /,
    *more: Path,
    voxel_size: float = 0.1,
    json: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Count the voxels that maps of the same scans fill; fewer is crisper.

    Parameters
    ----------
    map : Path
        Map file, all points in one frame.
    more : Path
        More maps to compare.
    voxel_size : float
        Voxel size [m].
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
        # In map coordinates all maps use one grid, with a corner at the origin of the first.
        origin = cloud.origin if origin is None else origin
        shift = cloud.origin - origin
        voxels = counted(cloud.points + shift if shift.any() else cloud.points, voxel_size)
        rows.append(
            {"map": str(path), "points": len(cloud), "voxels": voxels, "voxel_size_m": voxel_size}
        )
    if json:
        print_json({"maps": rows})
        return
    print_table(
        ("voxels filled", "of [m]", "points", "map"),
        [
            (f"{row['voxels']:,}", f"{voxel_size:g}", f"{row['points']:,}", str(row["map"]))
            for row in rows
        ],
    )
