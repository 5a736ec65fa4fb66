"""Madhavan and Messina 2003, section 3: range images of a ladar, registered by adaptive ICP."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scanlock.evaluation.crispness import VOXEL_SIZE
from scanlock.evaluation.voxel_map import VoxelMap
from scanlock.experiments.experiment import Contender, Experiment, Findings, Outcome, Section, Watch
from scanlock.experiments.ladar.claims import ladar_claims, ladar_remarks
from scanlock.experiments.ladar.figures import first_poses, first_scans, ladar_figures
from scanlock.experiments.ladar.outcome import LadarOutcome, measured
from scanlock.experiments.ladar.rows import ROWS, STARTS
from scanlock.experiments.ladar.series import ladar_pairs, ladar_series
from scanlock.experiments.ladar.tables import drive_table, paper_table, solved_table
from scanlock.experiments.pairwise import SOLVED, TRUTH, error_table, pair_table
from scanlock.geometry.pose import Pose
from scanlock.models.sensor_noise import SensorNoise
from scanlock.registration.methods.icp import Icp
from scanlock.registration.registry import METHODS
from scanlock.simulation import FacetLadar

PRINTED, ANNEALED = "ICP 2003", "annealed ICP"

_ABOUT = """\
Section 3 of Madhavan and Messina 2003 registers range images of a ladar (32 rows, 180 columns) on
an off-road vehicle by ICP with an adaptive limit on the distance of pairs. Table 1 has four:
consecutive images; images 20 frames apart; the latter with D moved by another metre along each
axis; and the first with D turned by 10 degrees and moved by 3 m along each axis. It prints the
mean distance of the closest points after registration, and the iterations; the true poses were not
known."""

_RESOLUTION = """\
How close two images can lie follows from the resolution of the ladar and from its way between
them: once it has moved, it meets other points of the same grass. The paper tells neither. The
speeds of the first two drives were chosen so that the exact pose leaves about what the paper
prints; the others are beyond it. A mean distance is thus to be held against that of the exact
pose, and proves no pose. It is taken over the pairs within the mean and three deviations of all,
those that the paper keeps where scans are well aligned."""

_SOLVED = f"""\
Places at which the pose ends within {SOLVED} of the true one, and over all frames and starts the
errors, with the poses that were called right."""


def ladar_contenders() -> list[Contender]:
    """Return the paper's method, those that it leaves to later work, and others."""
    noise = SensorNoise(range_deviation=FacetLadar().range_noise)
    icp = Icp()
    noisy = replace(icp, noise=noise, estimation=replace(icp.estimation, algorithm="gauss-newton"))
    planes = replace(icp.estimation, algorithm="gauss-newton", residual="point-to-plane")
    return [
        Contender(
            name=PRINTED,
            method=Icp.madhavan2003(),
            remark="all points, a Delaunay tessellation, limits from the statistics of all pairs; "
            "D is three times the spacing of M, and the end a change of 1 %, of which the paper "
            "tells no numbers",
        ),
        Contender(
            name="ICP",
            method=icp,
            remark="scanlock's own settings: points thinned to voxels of 0.5 m, limits from the "
            "statistics of the pairs that were kept, once the pose has settled",
        ),
        Contender(
            name="ICP with noise",
            method=noisy,
            remark="the same, pairs weighed by the noise of the ladar and its angles",
        ),
        Contender(
            name="ICP to planes",
            method=replace(icp, estimation=planes),
            remark="the same, to planes",
        ),
        Contender(
            name=ANNEALED,
            method=METHODS["icp-annealed"],
            remark="simulated annealing in front, as the paper proposes against wrong minima",
        ),
        *(
            Contender(name=name, method=METHODS[key], remark="scanlock's own settings")
            for name, key in (("G-ICP", "gicp"), ("NDT", "ndt"), ("SGC-NDT-D2D", "sgc-ndt-d2d"))
        ),
    ]


def _examine(outcome: Outcome, watch: Watch) -> Findings:
    found = measured(outcome, watch)
    table = paper_table(found)
    figures = ladar_figures(found, [PRINTED, ANNEALED])
    tracks = _tracks(found)
    return Findings(
        sections=[
            Section(
                title="Table 1",
                text="Medians over all places. Iterations are pairings of ICP, those of the "
                "descent that is kept where several are tried, and evaluations of the score for "
                "the other methods.",
                tables={"table-1": table},
            ),
            Section(
                title="What the paper says",
                claims=ladar_claims(found, PRINTED),
                remarks=ladar_remarks(found, PRINTED),
            ),
            Section(
                title="What a mean distance tells",
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
        trajectories=tracks,
        times=np.array([0.0, ROWS[-1].drive.apart / FacetLadar().rate]),
        headline=table,
        maps=_maps(found, {name: poses[1] for name, poses in tracks.items()}),
    )


def _tracks(found: LadarOutcome) -> dict[str, list[Pose]]:
    """Return M from M and D of row #4 at the first place, by contender and as it is true."""
    poses = first_poses(found, ROWS[-1])
    truth = found.pairs(ROWS[-1].drive)[0].truth
    if truth is not None:
        poses[TRUTH] = truth
    return {name: [Pose.identity(), pose] for name, pose in poses.items()}


def _maps(found: LadarOutcome, poses: dict[str, Pose]) -> dict[str, NDArray[np.float32]]:
    model, data = first_scans(found, ROWS[-1])
    maps: dict[str, NDArray[np.float32]] = {}
    for name, pose in poses.items():
        laid = VoxelMap(VOXEL_SIZE)
        laid.add(model)
        laid.add(pose.apply(data))
        maps[name] = laid.points
    return maps


LADAR = Experiment(
    name="ladar",
    title="Range images of a ladar on rugged terrain",
    about=_ABOUT,
    contenders=ladar_contenders(),
    simulated=ladar_series,
    scans=20,
    every=None,
    examine=_examine,
    starts=STARTS,
    pairs=ladar_pairs,
    pairing="two frames of each of four drives",
)
"""Section 3, Table 1 and Figures 2 and 3."""
