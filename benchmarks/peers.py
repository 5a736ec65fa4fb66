"""Peers that need no start, where they are installed: raw arrays in, a pose and a claim out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scanlock.geometry.pose import Pose
from scanlock.registration.methods import METHODS
from scanlock.registration.register import register

Cloud = NDArray[np.float64]

_FEATURE_VOXEL = 0.5
"""Open3D: the voxel [m] its features are taken from; normals within 2, features within 5 voxels."""

_LEAST_INLIERS = 5
"""KISS-Matcher: final inliers from which its own example takes a pose for found."""


@dataclass(frozen=True)
class Searcher:
    """Source and target in; a pose, and whether it claims to be right, out.

    None for a peer that claims nothing: Open3D gives a fitness and leaves its limit to the user.
    """

    name: str
    register: Callable[[Cloud, Cloud], tuple[Pose, bool | None]]


def ours(name: str, method: Any) -> Searcher:
    def run(source: Cloud, target: Cloud) -> tuple[Pose, bool]:
        result = register(source=source, target=target, method=method)
        return result.target_from_source, result.ok

    return Searcher(name, run)


def kiss_matcher_searcher() -> Searcher:
    import kiss_matcher
    import small_gicp

    def run(source: Cloud, target: Cloud) -> tuple[Pose, bool]:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        start = np.eye(4)
        start[:3, :3], start[:3, 3] = found.rotation, found.translation
        ended = small_gicp.align(
            target,
            source,
            init_T_target_source=start,
            registration_type="GICP",
            downsampling_resolution=0.25,
            max_correspondence_distance=1.0,
            num_threads=1,
            max_iterations=100,
        )
        claimed = matcher.get_num_final_inliers() >= _LEAST_INLIERS and ended.converged
        return Pose.from_matrix(ended.T_target_source), bool(claimed)

    return Searcher("KISS-Matcher + small_gicp GICP", run)


def open3d_searcher(kind: str) -> Searcher:
    import open3d

    features = open3d.pipelines.registration
    voxel = _FEATURE_VOXEL

    def thinned(points: Cloud) -> tuple[Any, Any]:
        # Open3D refuses read-only arrays.
        own = open3d.utility.Vector3dVector(np.array(points))
        cloud = open3d.geometry.PointCloud(own)
        cloud = cloud.voxel_down_sample(voxel)
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
        around = open3d.geometry.KDTreeSearchParamHybrid(5.0 * voxel, 100)
        return cloud, features.compute_fpfh_feature(cloud, around)

    def run(source: Cloud, target: Cloud) -> tuple[Pose, None]:
        (moves, own), (stays, other) = thinned(source), thinned(target)
        if kind == "FGR":
            option = features.FastGlobalRegistrationOption(maximum_correspondence_distance=voxel)
            first = features.registration_fgr_based_on_feature_matching(
                moves, stays, own, other, option
            )
        else:
            first = features.registration_ransac_based_on_feature_matching(
                moves, stays, own, other, True, 1.5 * voxel,
                features.TransformationEstimationPointToPoint(False), 3,
                [
                    features.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                    features.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
                ],
                features.RANSACConvergenceCriteria(100_000, 0.999),
            )  # fmt: skip
        ended = features.registration_icp(
            moves, stays, 2.0 * voxel, first.transformation,
            features.TransformationEstimationPointToPlane(),
        )  # fmt: skip
        return Pose.from_matrix(ended.transformation), None

    return Searcher(f"Open3D {kind} + ICP", run)


def searchers(peers: bool, methods: dict[str, Any] | None = None) -> list[Searcher]:
    chosen = methods or {"auto": METHODS["auto"]}
    found = [ours(f"scanlock {name}", method) for name, method in chosen.items()]
    for make in (
        kiss_matcher_searcher,
        lambda: open3d_searcher("FGR"),
        lambda: open3d_searcher("RANSAC"),
    ):
        if peers:
            try:
                found.append(make())
            except (ImportError, OSError) as error:
                print(f"left out: {error}")
    return found
