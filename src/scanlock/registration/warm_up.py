"""Compilation of all kernels ahead of time, by one call of each stage on a synthetic scan."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, get_args

import numpy as np

from scanlock.arrays import Points, read_only
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import require_count
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.sensor_noise import SensorNoise
from scanlock.optimisation.objectives.cell_scores import CellAssociation
from scanlock.registration.compile_ahead import compile_in_parallel, missing_kernels
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import Method
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.search.cluster_matching import ClusterMatcher
from scanlock.segmentation.clusters import ClusterFinder
from scanlock.segmentation.ground.finder import GroundFinder, PublishedGroundFinder
from scanlock.segmentation.segmentation import Segmenter, segment

_SENSOR_HEIGHT = 1.7
_PLANES = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")
_STEP = np.array([0.5, 0.2, 0.0])

_METHODS: tuple[Method[Any], ...] = (
    *METHODS.values(),
    *(Ndt(association=association, cell_sizes=(3.0,)) for association in get_args(CellAssociation)),
    NdtD2d(association="cells-around", cell_sizes=(3.0,)),
    Icp(search="delaunay", voxel_size=3.0),
    Icp(estimation=_PLANES, noise=SensorNoise()),
)
"""The registered methods, and settings that need further kernels."""


def warm_up(*, processes: int = 1) -> None:
    """Compile every kernel of segmentation and registration, or load it from disk.

    The machine code is cached on disk, so this takes its time once. All later calls run at full
    speed.

    Parameters
    ----------
    processes : int
        Number of processes that compile, this one included. More than one need the usual
        ``if __name__ == "__main__":`` in a script.

    Raises
    ------
    InvalidInput
        `processes` is not a whole number of at least 1.
    """
    require_count("processes", processes)
    if processes > 1:
        compile_in_parallel(missing_kernels(default_only=False), processes)
    for step in warm_up_steps():
        step()
    warm_up_verification()


def run_default() -> None:
    """Register two synthetic scans by the default method."""
    scan = _courtyard()
    register(source=scan + _STEP, target=scan)


def warm_up_verification() -> None:
    """Register with every method, after `warm_up_steps`, to compile the remaining kernels."""
    scan = _courtyard()
    for method in _METHODS:
        register(source=scan + _STEP, target=scan, method=method)


def warm_up_steps() -> list[Callable[[], object]]:
    """Return the stages of `warm_up`."""
    scan = _courtyard()
    cloud, moved = PointCloud.from_array(scan), PointCloud.from_array(scan + _STEP)
    above = read_only(scan[scan[:, 2] > 0.3 - _SENSOR_HEIGHT])
    tilted = scan @ exp_rotation(np.array([math.radians(12.0), 0.0, 0.0])).T
    matcher = ClusterMatcher()

    def match_clusters(level: Pose | None) -> None:
        gaussians = METHODS["sgc-ndt-d2d"].prepare(cloud).gaussians[-1]
        features = matcher.describe(gaussians, level)
        matcher.hypotheses(features, features)

    def align(method: Method[Any]) -> None:
        # Without the verification, which needs clusters for every method.
        method.align(method.prepare(cloud), method.prepare(moved), Pose.identity())

    stages = [
        partial(GroundFinder().find, cloud),
        partial(GroundFinder(max_tilt=math.pi).find, PointCloud.from_array(scan[:, ::-1])),
        partial(segment, scan),
        partial(segment, tilted),
        partial(Segmenter(ground=PublishedGroundFinder()).segment, scan),
        partial(ClusterFinder().grow, above),
        *(partial(match_clusters, level) for level in (Pose.identity(), None)),
    ]
    return [*stages, *(partial(align, method) for method in _METHODS)]


def _courtyard() -> Points:
    """Return a scan of level ground with posts and walls, without noise or random numbers."""
    radii, turns = np.meshgrid(np.linspace(2.0, 30.0, 60), np.linspace(0.0, 2.0 * np.pi, 120))
    ground = [radii * np.cos(turns), radii * np.sin(turns), np.zeros_like(radii)]
    posts = [
        np.meshgrid(x + np.linspace(0.0, 0.4, 4), y + np.linspace(0.0, 2.0, 6), _LEVELS)
        for x, y in zip(*_POSITIONS, strict=True)
    ]
    surfaces = [np.stack([np.ravel(axis) for axis in one], axis=1) for one in (ground, *posts)]
    return np.concatenate(surfaces) - [0.0, 0.0, _SENSOR_HEIGHT]


_LEVELS = np.linspace(0.4, 3.0, 12)
_ANGLES = np.arange(16) * 2.4
_POSITIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)]) * np.linspace(5.0, 25.0, 16)
"""Positions of the posts, rotated by the golden angle from one to the next, to avoid repetition."""
