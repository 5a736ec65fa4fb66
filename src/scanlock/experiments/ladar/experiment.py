"""Experiment of Madhavan and Messina 2003, section 3: contenders, page and figures."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scanlock.evaluation.crispness import VOXEL_SIZE
from scanlock.evaluation.voxel_map import VoxelMap
from scanlock.experiments.claims import judged
from scanlock.experiments.experiment import (
    Contender,
    Experiment,
    Findings,
    Outcome,
    Progress,
    Section,
)
from scanlock.experiments.ladar.claims import ladar_claims, ladar_remarks
from scanlock.experiments.ladar.figures import first_poses, first_scans, ladar_figures
from scanlock.experiments.ladar.outcome import LadarOutcome, measure_distances
from scanlock.experiments.ladar.rows import ROWS, STARTS
from scanlock.experiments.ladar.series import ladar_pairs, ladar_series
from scanlock.experiments.ladar.tables import drive_table, paper_table, solved_table
from scanlock.experiments.pairwise import SOLVED, TRUTH, error_table, pair_table
from scanlock.geometry.pose import Pose
from scanlock.models.sensor_noise import SensorNoise
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.registry import METHODS
from scanlock.simulation import FacetLadar

PUBLISHED, ANNEALED = "ICP 2003", "annealed ICP"

_DESCRIPTION = """\
Section 3 of Madhavan and Messina 2003 registers range images of a ladar (32 rows, 180 columns) on
an off-road vehicle by ICP with an adaptive maximum correspondence distance. Table 1 has four rows:
consecutive images; images 20 frames apart; the latter with D translated by 1 m along each axis; and
the first with D rotated by 10 degrees and translated by 3 m along each axis. It has the mean
distance of the closest points after registration and the iterations. The true poses are
unknown."""

_RESOLUTION = """\
The mean distance at the exact pose depends on the resolution of the ladar and on its motion between
two images, because a moved ladar samples other points of the same surface. The paper states
neither. The speeds of the first two drives give about the distances of the paper at the exact pose;
the other two drives are additional. A mean distance must be compared with that of the exact pose,
and does not prove a pose. It is over the correspondences below the mean plus three standard
deviations, those that the paper accepts for well aligned scans."""

_SOLVED = f"""\
Places with a pose within {SOLVED} of the true one. The errors and the poses with status ok are over
all frames and starts."""


def ladar_contenders() -> list[Contender]:
    """Return the method of the paper, its proposed extensions, and other methods."""
    noise = SensorNoise(range_deviation=FacetLadar().range_noise)
    icp = Icp()
    noisy = replace(icp, noise=noise, estimation=replace(icp.estimation, algorithm="gauss-newton"))
    planes = replace(icp.estimation, algorithm="gauss-newton", residual="point-to-plane")
    return [
        Contender(
            name=PUBLISHED,
            method=Icp.madhavan2003(),
            remark="all points, Delaunay tessellation, threshold from the statistics of all "
            "correspondences; D is three times the point spacing of M and the tolerance is a "
            "change of 1 %, both not stated in the paper",
        ),
        Contender(
            name="ICP",
            method=icp,
            remark="settings of scanlock: downsampled to voxels of 0.5 m, threshold from the "
            "statistics of the accepted correspondences after convergence",
        ),
        Contender(
            name="ICP with noise",
            method=noisy,
            remark="the same, correspondences weighted by the range and angle noise of the ladar",
        ),
        Contender(
            name="ICP to planes",
            method=replace(icp, estimation=planes),
            remark="the same, point to plane",
        ),
        Contender(
            name=ANNEALED,
            method=METHODS["icp-annealed"],
            remark="simulated annealing before ICP, as proposed in the paper against local minima",
        ),
        *(
            Contender(name=name, method=METHODS[key], remark="settings of scanlock")
            for name, key in (("G-ICP", "gicp"), ("NDT", "ndt"), ("SGC-NDT-D2D", "sgc-ndt-d2d"))
        ),
    ]


def _analyse(outcome: Outcome, progress: Progress) -> Findings:
    found = measure_distances(outcome, progress)
    table = paper_table(found)
    figures = ladar_figures(found, [PUBLISHED, ANNEALED])
    trajectories = _trajectories(found)
    return Findings(
        sections=[
            Section(
                title="Table 1",
                text="Medians over all places. Iterations are correspondence updates of ICP, those "
                "of the best run where there are several, and evaluations of the score for the "
                "other methods.",
                tables={"table-1": table},
            ),
            Section(
                title="Claims of the paper",
                claims=judged(ladar_claims(found, PUBLISHED), found.places, "places"),
                remarks=ladar_remarks(found, PUBLISHED),
            ),
            Section(
                title="Mean distances at the exact pose",
                text=_RESOLUTION,
                tables={"frames": drive_table(found)},
            ),
            Section(
                title="All frames from all starts",
                text=_SOLVED,
                tables={
                    "solved": solved_table(found),
                    "errors": error_table(outcome),
                    "pairs": pair_table(outcome),
                },
            ),
            Section(
                title="Range images (Figure 2 a, b)",
                figures={"range-images": figures["range-images"]},
            ),
            Section(
                title="Before and after, from above (Figures 2 c, 3 a and 3 b)",
                text="At the first place.",
                figures={"registration": figures["registration"]},
            ),
            Section(
                title="Closest points before and after (Figures 2 d and 3 d)",
                figures={"distances": figures["distances"]},
            ),
        ],
        trajectories=trajectories,
        times=np.array([0.0, ROWS[-1].drive.step / FacetLadar().rate]),
        headline=table,
        maps=_maps(found, {name: poses[1] for name, poses in trajectories.items()}),
    )


def _trajectories(found: LadarOutcome) -> dict[str, list[Pose]]:
    """Return the poses of M and D in M for row #4 at the first place, by contender and true."""
    poses = first_poses(found, ROWS[-1])
    truth = found.pairs(ROWS[-1].drive)[0].truth
    if truth is not None:
        poses[TRUTH] = truth
    return {name: [Pose.identity(), pose] for name, pose in poses.items()}


def _maps(found: LadarOutcome, poses: dict[str, Pose]) -> dict[str, NDArray[np.float32]]:
    model, data = first_scans(found, ROWS[-1])
    maps: dict[str, NDArray[np.float32]] = {}
    for name, pose in poses.items():
        voxels = VoxelMap(VOXEL_SIZE)
        voxels.add(model)
        voxels.add(pose.apply(data))
        maps[name] = voxels.points
    return maps


LADAR = Experiment(
    name="ladar",
    title="Range images of a ladar on rugged terrain",
    description=_DESCRIPTION,
    contenders=ladar_contenders(),
    simulate=ladar_series,
    scans=20,
    every=None,
    analyse=_analyse,
    starts=STARTS,
    pairs=ladar_pairs,
    pairs_text="two frames of each of four drives",
)
"""Section 3, Table 1 and Figures 2 and 3."""
