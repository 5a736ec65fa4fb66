"""``scanlock evaluate``: how far a trajectory is from the true one."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scanlock.cli.choices import Flag
from scanlock.errors import InvalidInput

if TYPE_CHECKING:
    from scanlock.arrays import Vector
    from scanlock.evaluation.trajectory_errors import TrajectoryErrors
    from scanlock.geometry.pose import Pose

_MOST_GAP = 0.05
"""Stamps farther apart than this are of other poses [s]; half a sweep at 10 Hz."""


def evaluate(
    estimate: Path,
    truth: Path,
    /,
    *,
    align: Annotated[Literal["none", "first", "all"], Parameter(negative="")] = "first",
    apart: int = 1,
    json: Flag = False,
) -> None:
    """Compare a trajectory with the true one: absolute, relative and KITTI errors.

    Parameters
    ----------
    estimate : Path
        The trajectory to judge, KITTI or TUM format.
    truth : Path
        The true one. Two TUM files are matched by time, otherwise row by row.
    align : str
        What is laid together before absolute errors: nothing, the first poses, all positions.
    apart : int
        How many rows the motions of the relative errors span.
    json : bool
        Print all numbers as JSON, and nothing else.
    """
    from scanlock.cli.screen import print_json, print_line, print_table
    from scanlock.evaluation.trajectory_errors import (
        absolute_errors,
        kitti_errors,
        relative_errors,
    )

    poses = _matched(estimate, truth)
    found = {
        "absolute": absolute_errors(*poses, align),
        f"relative, {apart} apart": relative_errors(*poses, apart),
    }
    kitti = kitti_errors(*poses)
    content: dict[str, Any] = {"poses": len(poses[0])}
    for name, errors in found.items():
        content[name] = {
            "translation_m": _summary(errors.translations),
            "rotation_deg": _summary(errors.rotations * (180.0 / math.pi)),
        }
    content["kitti"] = _kitti(kitti)
    if json:
        print_json(content)
        return
    heads = ("errors", "rmse", "mean", "median", "largest")
    rows = [
        (f"{name} [{unit}]", *(f"{content[name][key][part]:.4f}" for part in heads[1:]))
        for name in found
        for key, unit in (("translation_m", "m"), ("rotation_deg", "deg"))
    ]
    print_table(heads, rows)
    if content["kitti"] is None:
        print_line("KITTI errors need a path of more than 100 m")
    else:
        print_line(
            f"KITTI: {content['kitti']['translation_percent']:.4f} % and "
            f"{content['kitti']['rotation_deg_per_100_m']:.4f} deg/100 m over {len(kitti)} parts"
        )


def _matched(estimate: Path, truth: Path) -> "tuple[list[Pose], list[Pose]]":
    import numpy as np

    from scanlock.io.sequences import read_trajectory

    (here_times, here), (there_times, there) = read_trajectory(estimate), read_trajectory(truth)
    if here_times is None or there_times is None:
        if len(here) != len(there):
            raise InvalidInput(
                f"{estimate} has {len(here)} poses and {truth} {len(there)}; without times in both "
                "they must be as many, so give both in TUM format"
            )
        return here, there
    gaps = np.abs(np.asarray(here_times)[:, None] - np.asarray(there_times)[None])
    nearest = gaps.argmin(axis=1)
    near = np.flatnonzero(gaps[np.arange(len(here)), nearest] <= _MOST_GAP)
    if len(near) == 0:
        raise InvalidInput(
            f"no time in {estimate} is within {_MOST_GAP} s of one in {truth}; check that both "
            "count from the same moment"
        )
    return [here[row] for row in near], [there[nearest[row]] for row in near]


def _summary(values: "Vector") -> dict[str, float]:
    import numpy as np

    return {
        "rmse": float(np.sqrt(np.mean(values**2))),
        "mean": float(values.mean()),
        "median": float(np.median(values)),
        "largest": float(values.max()),
    }


def _kitti(errors: "TrajectoryErrors") -> dict[str, float] | None:
    if len(errors) == 0:
        return None
    return {
        "translation_percent": 100.0 * float((errors.translations / errors.lengths).mean()),
        "rotation_deg_per_100_m": 100.0
        * math.degrees(float((errors.rotations / errors.lengths).mean())),
        "parts": len(errors),
    }
