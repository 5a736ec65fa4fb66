"""``scanlock map``: a folder of scans to a trajectory and a map."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from scanlock.cli.choices import MethodName
from scanlock.errors import InvalidInput, require_count, require_positive

if TYPE_CHECKING:
    from scanlock.arrays import Vector
    from scanlock.io.sequences import ScanSequence
    from scanlock.pipelines.mapping import MappedScan
    from scanlock.registration.result import Registration

_TABLE = "scan,target,source,status,overlap,score,moved_m,turned_deg,evaluations,reason\n"


def map_folder(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    method: MethodName = "sgc-ndt-d2d",
    every: int = 1,
    scans: int | None = None,
    guess: Literal["identity", "velocity"] = "velocity",
    width: float = 0.1,
) -> int:
    """Register each scan to the one before, and lay all of them into one map.

    Parameters
    ----------
    folder : Path
        A folder of scans: plain, KITTI, Ford Campus, or of scanlock simulate.
    output : Path
        Folder for the trajectory, the map and the table of pairs; it must not hold a map yet.
    method : str
        How to register.
    every : int
        Take every k-th scan.
    scans : int
        Take so many at most; all by default.
    guess : str
        Where registrations begin: at no motion, or at the last one.
    width : float
        The map keeps one point in each voxel of this side [m].

    Returns
    -------
    int
        The exit code: 0 if every pair is to be trusted, 2 if not.
    """
    from scanlock.cli.compiling import compile_watch
    from scanlock.cli.screen import counting, print_facts, print_line, print_status
    from scanlock.experiments.voxel_map import VoxelMap
    from scanlock.io import atomic_file, write_kitti_poses, write_scan, write_tum_poses
    from scanlock.io.sequences import open_sequence
    from scanlock.pipelines.mapping import mapped_scans

    require_count("--every", every)
    require_count("--scans", 2 if scans is None else scans, 2)
    require_positive("--width", width, unit="m")
    if (output / "map.ply").exists():
        raise InvalidInput(f"{output} holds a map already; name another folder, or remove it")
    sequence = open_sequence(folder).taken(every, scans)
    if len(sequence) < 2:
        raise InvalidInput(f"{folder} must give at least 2 scans to map, got {len(sequence)}")
    output.mkdir(parents=True, exist_ok=True)
    laid, done = VoxelMap(width), list["MappedScan"]()
    with compile_watch():
        steps = mapped_scans(
            (sequence.scan(index) for index in counting(range(len(sequence)), "scans")),
            method=method,
            guess=guess,
        )
        for step in steps:
            laid.add(step.pose.apply(step.cloud.points + step.cloud.origin))
            done.append(step)
    poses = [step.pose for step in done]
    write_kitti_poses(output / "trajectory_kitti.txt", poses)
    write_tum_poses(output / "trajectory_tum.txt", sequence.times, poses)
    write_scan(output / "map.ply", laid.points)
    with atomic_file(output / "pairs.csv") as handle:
        handle.write(_table(sequence, done).encode())
    doubtful = [sequence.names[index] for index, step in enumerate(done) if not step.ok]
    count = len(done) - 1
    print_status(
        "ok" if not doubtful else "doubtful",
        f"{count - len(doubtful)} of {count} pairs are to be trusted",
        good=not doubtful,
    )
    facts = [
        ("scans", f"{len(done)} of {folder} ({sequence.title})"),
        ("path", f"{_length(poses[0].translation, [pose.translation for pose in poses]):.1f} m"),
        ("map", f"{len(laid):,} voxels of {width:g} m filled"),
    ]
    if doubtful:
        shown = ", ".join(doubtful[:8]) + (", ..." if len(doubtful) > 8 else "")
        facts.append(("not ok", f"the motions to {shown}: all after them stands on these"))
    print_facts(facts)
    print_line(f"wrote map.ply, trajectories and pairs.csv to {output}")
    return 2 if doubtful else 0


def _table(sequence: "ScanSequence", steps: "list[MappedScan]") -> str:
    rows = [
        _row(index, sequence.names[index - 1], sequence.names[index], step.registration)
        for index, step in enumerate(steps)
        if step.registration is not None
    ]
    return _TABLE + "".join(rows)


def _row(index: int, target: str, source: str, found: "Registration") -> str:
    from scanlock.geometry.pose import Pose

    metres, radians = found.target_from_source.distance(Pose.identity())
    reason = found.reason.replace('"', "'")
    return (
        f"{index},{target},{source},{found.status.value},{found.overlap:.6f},{found.score:.6f},"
        f'{metres:.6f},{math.degrees(radians):.6f},{found.iterations},"{reason}"\n'
    )


def _length(start: "Vector", places: "list[Vector]") -> float:
    import numpy as np

    return float(np.linalg.norm(np.diff(np.array([start, *places]), axis=0), axis=1).sum())
