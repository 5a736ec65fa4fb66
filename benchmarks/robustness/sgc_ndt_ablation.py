"""Ablation of SGC-NDT D2D: basin and accuracy with one choice changed at a time.

    python -m benchmarks.robustness.sgc_ndt_ablation --data FOLDER [--starts 10]

Five pairs of a city drive, ten scans apart; starts as in `basin`, about the vertical axis. Accuracy
is the median error of the solved starts of the nearest level.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import is_solved, pose_error
from benchmarks._common.real_scans import RealPair, kitti_drive
from benchmarks._common.results import Results
from benchmarks._common.starts import LEVELS, random_start
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_means
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.optimisation.solvers.newton import Newton
from scanlock.registration.methods.coarse_to_fine import (
    DEFAULT_SCALES,
    PAPER_SCALES,
    CoarseToFine,
    Scale,
)
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.segmentation.cluster_gaussians import ClusterGaussians

Prepare = Callable[[PointCloud], ClusterGaussians]
Align = Callable[[ClusterGaussians, ClusterGaussians, Pose], Pose]

DEFAULT = SgcNdt()
POINT_WEIGHTS = SgcNdt(
    schedule=CoarseToFine(scales=(*DEFAULT_SCALES[:-1], Scale(smoothing=0.0, max_radius=1.5)))
)
ONE_RADIUS = SgcNdt(
    schedule=CoarseToFine(
        scales=tuple(
            Scale(smoothing=metres, max_radius=3.0) for metres in (8.0, 4.0, 2.0, 1.0, 0.0)
        )
    )
)


def aligned_by(method: SgcNdt) -> Align:
    """Return the alignment of a method."""
    return lambda target, source, start: method.align(target, source, start).pose


def with_multiplied_covariances(
    target: ClusterGaussians, source: ClusterGaussians, start: Pose
) -> Pose:
    """Align with covariances multiplied by 10^2, 5^2, 2^2 and 1, without smoothing."""
    pose = start
    for factor in (10.0, 5.0, 2.0, 1.0):
        objective = GaussiansToGaussians(
            target=target.gaussians[-1].scaled(factor), source=source.gaussians[-1].scaled(factor)
        )
        pose = Newton().minimise(objective, pose).pose
    return pose


def reweighted(
    method: SgcNdt, weights: Callable[[ClusterGaussians, Gaussians], Gaussians]
) -> Prepare:
    """Return the preparation of a method with other weights of the Gaussians."""

    def prepare(cloud: PointCloud) -> ClusterGaussians:
        clusters = method.prepare(cloud)
        scales = tuple(weights(clusters, gaussians) for gaussians in clusters.gaussians)
        return replace(clusters, gaussians=scales)

    return prepare


def voxel_weights(clusters: ClusterGaussians, gaussians: Gaussians) -> Gaussians:
    """Weight each Gaussian by the number of occupied voxels of 0.3 m nearest to it."""
    _, nearest = cKDTree(gaussians.means).query(voxel_means(clusters.obstacles, 0.3))
    counts = np.maximum(np.bincount(nearest, minlength=len(gaussians)), 1)
    return Gaussians.from_covariances(gaussians.means, gaussians.covariances, counts)


def equal_weights(_: ClusterGaussians, gaussians: Gaussians) -> Gaussians:
    """Weight all Gaussians equally."""
    return Gaussians.from_covariances(
        gaussians.means, gaussians.covariances, np.ones_like(gaussians.counts)
    )


VARIANTS: dict[str, tuple[Prepare, Align]] = {
    "default": (DEFAULT.prepare, aligned_by(DEFAULT)),
    "one scale, as in the paper": (
        SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES)).prepare,
        aligned_by(SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES))),
    ),
    "weights by points at the last scale too": (POINT_WEIGHTS.prepare, aligned_by(POINT_WEIGHTS)),
    "clusters of 3 m at every scale": (ONE_RADIUS.prepare, aligned_by(ONE_RADIUS)),
    "the same, covariances multiplied": (ONE_RADIUS.prepare, with_multiplied_covariances),
    "weights by occupied voxels": (reweighted(DEFAULT, voxel_weights), aligned_by(DEFAULT)),
    "equal weights": (reweighted(DEFAULT, equal_weights), aligned_by(DEFAULT)),
}


def row(name: str, prepare: Prepare, align: Align, pairs: list[RealPair], starts: int) -> list[str]:
    """Return the cells of one variant."""
    clouds = [
        [prepare(PointCloud.from_array(load())) for load in (pair.load_target, pair.load_source)]
        for pair in pairs
    ]
    cells = [name]
    nearest: list[tuple[float, float]] = []
    for metres, degrees in LEVELS:
        errors: list[tuple[float, float]] = []
        for index, (pair, (target, source)) in enumerate(zip(pairs, clouds, strict=True)):
            rng = np.random.default_rng([index, int(metres * 10)])
            for _ in range(starts):
                start = random_start(pair.truth, metres, degrees, "vertical", rng)
                errors.append(pose_error(align(target, source, start), pair.truth))
        nearest = nearest or [error for error in errors if is_solved(error)]
        cells.append(f"{sum(is_solved(error) for error in errors)} / {len(errors)}")
    metres, degrees = np.median(nearest, axis=0)
    return [*cells, f"{100 * metres:.1f} cm, {degrees:.3f}°"]


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--starts", type=int, default=10, help="starts per level and pair")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    pairs = list(kitti_drive(arguments.data, 10))[::11]
    results.print_machine()
    results.add_table(
        ("variant", *(f"{m:g} m, {d:g}°" for m, d in LEVELS), "accuracy"),
        (row(name, *parts, pairs, arguments.starts) for name, parts in VARIANTS.items()),
        title="variants of SGC-NDT",
    )


if __name__ == "__main__":
    main()
