"""What single choices of SGC-NDT D2D are worth: basin and precision with each one changed.

    python benchmarks/choices.py --data FOLDER [--starts 10]

Five pairs of a city drive, ten scans apart; starts as in basin.py, about the vertical axis.
Precision is the median error of the solved starts of the nearest level.
"""

import argparse
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from basin import LEVELS, random_start
from contenders import is_solved, pose_error
from real_scans import RealPair, kitti_drive
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
from tables import machine, print_table

Prepare = Callable[[PointCloud], ClusterGaussians]
Align = Callable[[ClusterGaussians, ClusterGaussians, Pose], Pose]

DEFAULT = SgcNdt()
POINT_WEIGHTS = SgcNdt(
    schedule=CoarseToFine(scales=(*DEFAULT_SCALES[:-1], Scale(smoothing=0.0, max_radius=1.5)))
)
ONE_RADIUS = SgcNdt(
    schedule=CoarseToFine(
        scales=tuple(Scale(smoothing=blur, max_radius=3.0) for blur in (8.0, 4.0, 2.0, 1.0, 0.0))
    )
)


def aligned_by(method: SgcNdt) -> Align:
    return lambda target, source, start: method.align(target, source, start).pose


def multiplied(target: ClusterGaussians, source: ClusterGaussians, start: Pose) -> Pose:
    """Covariances multiplied by 10^2, 5^2, 2^2, 1 instead of blurs added."""
    pose = start
    for factor in (10.0, 5.0, 2.0, 1.0):
        objective = GaussiansToGaussians(
            target=target.gaussians[-1].scaled(factor), source=source.gaussians[-1].scaled(factor)
        )
        pose = Newton().minimise(objective, pose).pose
    return pose


def weighed(method: SgcNdt, weigh: Callable[[ClusterGaussians, Gaussians], Gaussians]) -> Prepare:
    def prepare(cloud: PointCloud) -> ClusterGaussians:
        marks = method.prepare(cloud)
        scales = tuple(weigh(marks, gaussians) for gaussians in marks.gaussians)
        return replace(marks, gaussians=scales)

    return prepare


def voxel_weights(marks: ClusterGaussians, gaussians: Gaussians) -> Gaussians:
    """Weights by occupied voxels of 0.3 m nearest to each Gaussian instead of points."""
    _, owner = cKDTree(gaussians.means).query(voxel_means(marks.obstacles, 0.3))
    counts = np.maximum(np.bincount(owner, minlength=len(gaussians)), 1)
    return Gaussians.from_covariances(gaussians.means, gaussians.covariances, counts)


def equal_weights(marks: ClusterGaussians, gaussians: Gaussians) -> Gaussians:
    return Gaussians.from_covariances(
        gaussians.means, gaussians.covariances, np.ones_like(gaussians.counts)
    )


VARIANTS: dict[str, tuple[Prepare, Align]] = {
    "default": (DEFAULT.prepare, aligned_by(DEFAULT)),
    "one scale, as in the paper": (
        SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES)).prepare,
        aligned_by(SgcNdt(schedule=CoarseToFine(scales=PAPER_SCALES))),
    ),
    "point weights at the last scale too": (POINT_WEIGHTS.prepare, aligned_by(POINT_WEIGHTS)),
    "clusters of 3 m at every scale": (ONE_RADIUS.prepare, aligned_by(ONE_RADIUS)),
    "the same, covariances multiplied": (ONE_RADIUS.prepare, multiplied),
    "weights by occupied voxels": (weighed(DEFAULT, voxel_weights), aligned_by(DEFAULT)),
    "equal weights": (weighed(DEFAULT, equal_weights), aligned_by(DEFAULT)),
}


def row(name: str, prepare: Prepare, align: Align, pairs: list[RealPair], starts: int) -> list[str]:
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
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--starts", type=int, default=10, help="starts a level and pair")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    pairs = list(kitti_drive(arguments.data, 10))[::11]
    print(machine(), "\n")
    header = ("choice", *(f"{m:g} m, {d:g}°" for m, d in LEVELS), "precision")
    print_table(
        header, (row(name, *parts, pairs, arguments.starts) for name, parts in VARIANTS.items())
    )


if __name__ == "__main__":
    main()
