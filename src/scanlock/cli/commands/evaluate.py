"""``scanlock evaluate``: errors of a trajectory against ground truth."""

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from scanlock.cli.option_types import Flag
from scanlock.errors import require_count

if TYPE_CHECKING:
    from scanlock.cli.trajectory_pair import TrajectoryPair
    from scanlock.evaluation.alignment import Alignment

_SHOWN = ("rmse", "mean", "median", "std", "largest")

_ALIGNED = {
    "none": "without alignment",
    "first": "first poses aligned",
    "all": "all positions aligned",
    "all+scale": "all positions aligned with scale",
}


def evaluate(
    estimate: Path,
    truth: Path,
    /,
    *,
    align: Annotated[Literal["none", "first", "all", "all+scale"], Parameter(negative="")] = (
        "first"
    ),
    delta: float = 1.0,
    unit: Literal["scans", "m", "s"] = "scans",
    all_pairs: Flag = False,
    first: int | None = None,
    axes: Literal["auto", "same", "camera"] = "auto",
    calib: Path | None = None,
    picture: Path | None = None,
    json: Flag = False,
) -> None:
    """Compute absolute (APE), relative (RPE) and KITTI errors of a trajectory.

    Parameters
    ----------
    estimate : Path
        The estimated trajectory, KITTI or TUM format.
    truth : Path
        The true trajectory, or a folder of scans with poses. Matched by time if both have times,
        else by the names or numbers of the scans, else by row.
    align : str
        Alignment before absolute errors: none, the first poses, all positions, or all positions
        with a scale.
    delta : float
        Distance between the poses of the relative errors.
    unit : str
        Unit of delta: scans, m of the true path, or s.
    all_pairs : bool
        Relative errors from each pose on, not only from the end of the previous motion.
    first : int
        Compare the first N matching poses only.
    axes : str
        Sensor frame of the truth: recognise KITTI's camera frame (auto), take it as it is (same),
        or convert it from KITTI's camera frame (camera).
    calib : Path
        KITTI's calib.txt, for an exact conversion from the camera frame.
    picture : Path
        File for a picture of both trajectories and the errors: .png, .pdf or .svg.
    json : bool
        Print all numbers as JSON, and nothing else.
    """
    from scanlock.cli.console import print_json, print_line
    from scanlock.cli.output import require_folder, require_picture
    from scanlock.cli.trajectory_pair import in_one_frame, pair_trajectories
    from scanlock.evaluation.error_summary import summarise
    from scanlock.evaluation.trajectory_errors import relative_errors
    from scanlock.io.sequences.trajectory import open_trajectory
    from scanlock.report.canvas import save_figure
    from scanlock.report.trajectory_figure import trajectory_figure

    if picture is not None:
        require_picture(picture)
        require_folder(picture)
    if first is not None:
        require_count("--first", first, 2)
    true = open_trajectory(truth)
    pair = pair_trajectories(open_trajectory(estimate), true, first)
    pair = in_one_frame(pair, true, axes, calib)
    poses = pair.estimate, pair.truth
    motions = relative_errors(*poses, delta, unit, all_pairs=all_pairs, times=pair.times)
    relative = {"delta": delta, "unit": unit, "pairs": len(motions), "all_pairs": all_pairs}
    content = _content(pair, align, relative | summarise(motions))
    if picture is not None:
        figure = trajectory_figure(
            *poses,
            alignment=align,
            relative=motions,
            apart=_apart(relative),
            times=pair.times if unit == "s" else None,
            title=f"{estimate.name} and {truth.name}",
        )
        save_figure(picture, figure)
    if json:
        print_json(content)
        return
    _show(content)
    if picture is not None:
        print_line(f"wrote {picture}")


def _content(
    pair: "TrajectoryPair", align: "Alignment", relative: dict[str, Any]
) -> dict[str, Any]:
    from scanlock.evaluation.alignment import find_alignment
    from scanlock.evaluation.error_summary import summarise, summarise_kitti
    from scanlock.evaluation.plausibility import find_warnings
    from scanlock.evaluation.trajectory_errors import absolute_errors, kitti_errors, path_lengths

    poses = pair.estimate, pair.truth
    kitti = [asdict(one) for one in summarise_kitti(kitti_errors(*poses))]
    return {
        "poses": len(pair.truth),
        "matched_by": pair.matched_by,
        "estimate_poses": pair.counts[0],
        "truth_poses": pair.counts[1],
        "path_m": float(path_lengths(pair.truth)[-1]),
        "frame": pair.frame,
        "notes": list(pair.notes),
        "warnings": find_warnings(*poses),
        "absolute": {
            "align": align,
            "scale": find_alignment(*poses, align).scale,
            **summarise(absolute_errors(*poses, align)),
        },
        "relative": relative,
        "kitti": {**kitti[0], "by_length": kitti[1:]} if kitti else None,
    }


def _show(content: dict[str, Any]) -> None:
    from scanlock.cli.console import print_facts, print_line, print_table, print_title

    absolute, relative = content["absolute"], content["relative"]
    print_title(
        f"{absolute['translation_m']['rmse']:.3f} m and {absolute['rotation_deg']['rmse']:.3f} deg "
        f"off (rmse) over {content['path_m']:.1f} m, {_ALIGNED[absolute['align']]}"
    )
    facts = [
        (
            "matched",
            f"{content['poses']:,} poses by {content['matched_by']}, of "
            f"{content['estimate_poses']:,} estimated and {content['truth_poses']:,} true",
        )
    ]
    if absolute["scale"] != 1.0:
        facts.append(("scale", f"{absolute['scale']:.6f}"))
    facts.extend(("note", text) for text in content["notes"])
    facts.extend(("warning", text) for text in content["warnings"])
    print_facts(facts)
    names = {"absolute": "absolute (APE)", "relative": f"relative over {_apart(relative)} (RPE)"}
    rows = [
        (f"{name} [{unit}]", *(f"{content[key][quantity][part]:.4f}" for part in _SHOWN))
        for key, name in names.items()
        for quantity, unit in (("translation_m", "m"), ("rotation_deg", "deg"))
    ]
    print_table(("errors", *_SHOWN), rows)
    kitti = content["kitti"]
    if kitti is None:
        print_line("KITTI errors need a path of more than 100 m")
        return
    longest = kitti["by_length"][-1]["length_m"]
    lengths = "100 m" if longest == 100.0 else f"100 to {longest:.0f} m"
    print_line(
        f"KITTI: {kitti['translation_percent']:.4f} % and "
        f"{kitti['rotation_deg_per_100_m']:.4f} deg/100 m over {kitti['segments']} segments of "
        f"{lengths}"
    )


def _apart(relative: dict[str, Any]) -> str:
    """Return the distance of the poses of relative errors with its unit."""
    is_next = relative["unit"] == "scans" and relative["delta"] == 1.0
    return "1 scan" if is_next else f"{relative['delta']:g} {relative['unit']}"
