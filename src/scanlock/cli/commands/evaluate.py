"""``scanlock evaluate``: errors of a trajectory against ground truth."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scanlock.cli.option_types import Flag
from scanlock.errors import FormatError, InvalidInput

if TYPE_CHECKING:
    from scanlock.arrays import Labels, Vector
    from scanlock.evaluation.trajectory_errors import TrajectoryErrors
    from scanlock.geometry.pose import Pose

_MAX_TIME_DIFFERENCE = 0.05
"""Maximum time difference of matching poses [s]; half a sweep at 10 Hz."""

_PARTS = ("rmse", "mean", "median", "largest")


def evaluate(
    estimate: Path,
    truth: Path,
    /,
    *,
    align: Annotated[Literal["none", "first", "all"], Parameter(negative="")] = "first",
    step: int = 1,
    picture: Path | None = None,
    json: Flag = False,
) -> None:
    """Compute absolute, relative and KITTI errors of a trajectory.

    Parameters
    ----------
    estimate : Path
        The estimated trajectory, KITTI or TUM format.
    truth : Path
        The true trajectory, or a folder of scans with poses. Matched by time if both have
        times, else by row.
    align : str
        Alignment before absolute errors: none, the first poses, or all positions.
    step : int
        Number of rows between the poses of the relative errors.
    picture : Path
        File for a picture of both trajectories and the errors: .png, .pdf or .svg.
    json : bool
        Print all numbers as JSON, and nothing else.
    """
    from scanlock.cli.console import print_json, print_line
    from scanlock.cli.output import make_room, require_picture

    if picture is not None:
        require_picture(picture)
    matched = _matched(_read(estimate), _read(truth))
    content = _content(matched, align, step)
    if picture is not None:
        from scanlock.report.canvas import save_figure
        from scanlock.report.trajectory_figure import trajectory_figure

        make_room(picture)
        title = f"{estimate.name} and {truth.name}"
        both = matched.estimate, matched.truth
        save_figure(picture, trajectory_figure(*both, alignment=align, title=title))
    if json:
        print_json(content)
        return
    _show(content)
    if picture is not None:
        print_line(f"wrote {picture}")


@dataclass(frozen=True, slots=True, eq=False)
class _Track:
    path: Path
    times: "Vector | None"
    poses: "list[Pose]"


@dataclass(frozen=True, slots=True, eq=False)
class _Matched:
    estimate: "list[Pose]"
    truth: "list[Pose]"
    counts: tuple[int, int]


def _read(path: Path) -> _Track:
    from scanlock.io.sequences import open_sequence, read_trajectory

    if not path.is_dir():
        return _Track(path, *read_trajectory(path))
    sequence = open_sequence(path)
    if not sequence.poses:
        raise FormatError(
            f"{path}: expected a folder of scans with their poses, found none ({sequence.title}); "
            "name a file of poses"
        )
    return _Track(path, sequence.times, list(sequence.poses))


def _matched(here: _Track, there: _Track) -> _Matched:
    counts = len(here.poses), len(there.poses)
    if here.times is not None and there.times is not None:
        first, second = _pairs(here.times, there.times)
        if len(first) == 0:
            raise InvalidInput(
                f"no time in {here.path} is within {_MAX_TIME_DIFFERENCE} s of one in "
                f"{there.path}; check that both use the same clock"
            )
        poses = [here.poses[row] for row in first], [there.poses[row] for row in second]
        return _Matched(*poses, counts)
    if counts[0] != counts[1]:
        raise InvalidInput(
            f"{here.path} has {counts[0]} poses and {there.path} {counts[1]}; without times "
            "both must have the same number; use TUM format for both"
        )
    return _Matched(here.poses, there.poses, counts)


def _pairs(here: "Vector", there: "Vector") -> "tuple[Labels, Labels]":
    """Return the rows of matching times, in order of time; each row at most once."""
    import numpy as np

    order = np.argsort(there, kind="stable")
    after = np.searchsorted(there[order], here).clip(1, max(len(there) - 1, 1))
    sides = np.stack([after - 1, np.minimum(after, len(there) - 1)])
    differences = np.abs(there[order][sides] - here)
    nearest = order[np.take_along_axis(sides, differences.argmin(axis=0)[None], axis=0)[0]]
    difference = differences.min(axis=0)
    # Of several rows with the same match the closest in time is kept.
    rows = np.argsort(difference, kind="stable")
    rows = rows[difference[rows] <= _MAX_TIME_DIFFERENCE]
    _, once = np.unique(nearest[rows], return_index=True)
    rows = rows[once]
    rows = rows[np.argsort(here[rows], kind="stable")]
    return rows, nearest[rows]


def _content(
    matched: _Matched, align: Literal["none", "first", "all"], step: int
) -> dict[str, Any]:
    from scanlock.evaluation.trajectory_errors import (
        absolute_errors,
        kitti_errors,
        path_lengths,
        relative_errors,
    )

    poses = matched.estimate, matched.truth
    return {
        "poses": len(matched.truth),
        "estimate_poses": matched.counts[0],
        "truth_poses": matched.counts[1],
        "path_m": float(path_lengths(matched.truth)[-1]),
        "absolute": {"align": align, **_summary(absolute_errors(*poses, align))},
        "relative": {"step": step, **_summary(relative_errors(*poses, step))},
        "kitti": _kitti(kitti_errors(*poses)),
    }


def _summary(errors: "TrajectoryErrors") -> dict[str, dict[str, float]]:
    import numpy as np

    def summed(values: "Vector") -> dict[str, float]:
        numbers = np.sqrt(np.mean(values**2)), values.mean(), np.median(values), values.max()
        return {name: float(value) for name, value in zip(_PARTS, numbers, strict=True)}

    return {
        "translation_m": summed(errors.translations),
        "rotation_deg": summed(errors.rotations * (180.0 / math.pi)),
    }


def _kitti(errors: "TrajectoryErrors") -> dict[str, float] | None:
    if len(errors) == 0:
        return None
    return {
        "translation_percent": 100.0 * float((errors.translations / errors.lengths).mean()),
        "rotation_deg_per_100_m": 100.0
        * math.degrees(float((errors.rotations / errors.lengths).mean())),
        "segments": len(errors),
    }


def _show(content: dict[str, Any]) -> None:
    from scanlock.cli.console import print_line, print_table, print_title

    print_title(
        f"{content['poses']:,} poses matched, of {content['estimate_poses']:,} estimated and "
        f"{content['truth_poses']:,} true, over {content['path_m']:.1f} m"
    )
    names = {"absolute": "absolute", "relative": f"relative, {content['relative']['step']} apart"}
    rows = [
        (f"{name} [{unit}]", *(f"{content[key][quantity][part]:.4f}" for part in _PARTS))
        for key, name in names.items()
        for quantity, unit in (("translation_m", "m"), ("rotation_deg", "deg"))
    ]
    print_table(("errors", *_PARTS), rows)
    kitti = content["kitti"]
    if kitti is None:
        print_line("KITTI errors need a path of more than 100 m")
        return
    print_line(
        f"KITTI: {kitti['translation_percent']:.4f} % and "
        f"{kitti['rotation_deg_per_100_m']:.4f} deg/100 m over {kitti['segments']} segments"
    )
