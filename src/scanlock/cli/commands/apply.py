"""``scanlock apply``: a cloud moved by a pose."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from scanlock.cli.option_types import Flag
from scanlock.cli.scan_input import Reading
from scanlock.errors import InvalidInput


def apply(
    pose: Path,
    cloud: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    inverse: Flag = False,
    force: Flag = False,
    reading: Reading | None = None,
) -> None:
    """Move a cloud by a pose, with all its fields.

    Parameters
    ----------
    pose : Path
        Pose file: a 4x4 matrix in text, .json or .npy, as scanlock register writes it.
    cloud : Path
        The cloud to move: the source of that registration, or another one in its frame.
    output : Path
        File for the moved cloud; its ending gives the format.
    inverse : bool
        Move by the inverse pose.
    force : bool
        Apply a pose that its file calls not verified.
    """
    from scanlock.cli.console import print_line
    from scanlock.cli.output import require_apart, require_folder, require_scan_file, write_cloud
    from scanlock.io.poses.pose_files import read_pose, read_pose_comment
    from scanlock.io.transform import transform_scan

    require_scan_file(output)
    require_folder(output)
    require_apart(output, (pose, cloud))
    moved_by = read_pose(pose)
    comment = read_pose_comment(pose)
    if comment.startswith("not verified") and not force:
        raise InvalidInput(f"{pose} is {comment}; pass --force to apply it all the same")
    scan = (reading or Reading()).load(cloud).file
    moved = transform_scan(scan, moved_by.inverse() if inverse else moved_by)
    written = write_cloud(output, moved)
    print_line(f"wrote {output}, {len(written):,} points")
