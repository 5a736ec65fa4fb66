"""Peers, where they are installed, and who is compared with and without a start."""

import shlex
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from contenders import Claimed, Cloud, Contender, ours
from scanlock.geometry.pose import Pose
from scanlock.registration.registry import METHODS

_Made = TypeVar("_Made")

_FEATURE_VOXEL = 0.5
"""Open3D: the voxel [m] its features are taken from; normals within 2, features within 5 voxels."""

_ICP_VOXELS = (1.0, 0.5, 0.25)
"""Open3D: the voxels [m] of its multi-scale ICP; pairs within 2 voxels."""

_LEAST_INLIERS = 5
"""KISS-Matcher: final inliers from which its own example takes a pose for found."""


def small_gicp_peer(kind: str, gate: float = 1.0, threads: int = 1) -> Contender:
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        result = small_gicp.align(
            target,
            source,
            init_T_target_source=np.eye(4) if start is None else start.matrix,
            registration_type=kind,
            downsampling_resolution=0.25,
            max_correspondence_distance=gate,
            num_threads=threads,
            max_iterations=100,
        )
        # Its step tolerance can leave the matrix a rounding away from a rotation.
        return Pose.from_matrix(result.T_target_source), bool(result.converged)

    return Contender(f"small_gicp {kind}, {gate:g} m", run)


def kiss_icp_peer(threads: int = 1) -> Contender:
    """Return KISS-ICP with a map that holds the target alone, every setting its own default."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    config = load_config(None)
    config.data.deskew = False
    config.registration.max_num_threads = threads

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        odometry = KissICP(config)
        none = np.zeros(0)
        sides = (odometry.preprocessor.preprocess(one, none, np.eye(4)) for one in (target, source))
        (_, kept), (moving, _) = (odometry.voxelize(side) for side in sides)
        odometry.local_map.update(kept, np.eye(4))
        sigma = odometry.adaptive_threshold.get_threshold()
        matrix = odometry.registration.align_points_to_map(
            moving, odometry.local_map, np.eye(4) if start is None else start.matrix,
            3.0 * sigma, sigma,
        )  # fmt: skip
        return Pose.from_matrix(matrix), None

    return Contender("KISS-ICP", run)


def open3d_icp_peer() -> Contender:
    import open3d

    registration = open3d.pipelines.registration

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        moves, stays = open3d_cloud(source), open3d_cloud(target)
        matrix = np.eye(4) if start is None else start.matrix
        for voxel in _ICP_VOXELS:
            fixed = stays.voxel_down_sample(voxel)
            fixed.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
            matrix = registration.registration_icp(
                moves.voxel_down_sample(voxel), fixed, 2.0 * voxel, matrix,
                registration.TransformationEstimationPointToPlane(),
            ).transformation  # fmt: skip
        return Pose.from_matrix(matrix), None

    return Contender("Open3D ICP to planes, 3 scales", run)


def open3d_features_peer(kind: str) -> Contender:
    import open3d

    features = open3d.pipelines.registration
    voxel = _FEATURE_VOXEL

    def thinned(points: Cloud) -> tuple[Any, Any]:
        cloud = open3d_cloud(points).voxel_down_sample(voxel)
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
        around = open3d.geometry.KDTreeSearchParamHybrid(5.0 * voxel, 100)
        return cloud, features.compute_fpfh_feature(cloud, around)

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
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

    return Contender(f"Open3D {kind} + ICP", run)


def open3d_cloud(points: Cloud) -> Any:
    import open3d

    # Open3D refuses read-only arrays.
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.array(points)))


def kiss_matcher_peer(threads: int = 1) -> Contender:
    import kiss_matcher

    fine = small_gicp_peer("GICP", threads=threads)

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        rough = np.eye(4)
        rough[:3, :3], rough[:3, 3] = found.rotation, found.translation
        pose, converged = fine.register(source, target, Pose.from_matrix(rough))
        return pose, bool(matcher.get_num_final_inliers() >= _LEAST_INLIERS and converged)

    return Contender("KISS-Matcher + small_gicp GICP", run)


Judged = tuple[Pose, bool, float]
"""A pose, whether the tool says it is right, and its own number for that, larger for better."""


@dataclass(frozen=True)
class Judge:
    """A peer with what it says about its own result."""

    name: str
    register: Callable[[Cloud, Cloud, Pose | None], Judged]


def small_gicp_judge() -> Judge:
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Judged:
        stays, tree = small_gicp.preprocess_points(target, downsampling_resolution=0.25)
        moves, _ = small_gicp.preprocess_points(source, downsampling_resolution=0.25)
        result = small_gicp.align(
            stays, moves, tree, np.eye(4) if start is None else start.matrix,
            registration_type="GICP", max_correspondence_distance=1.0, max_iterations=100,
        )  # fmt: skip
        inliers = result.num_inliers / max(1, moves.size())
        return Pose.from_matrix(result.T_target_source), bool(result.converged), inliers

    return Judge("small_gicp GICP: converged, inliers", run)


def open3d_judge() -> Judge:
    import open3d

    registration = open3d.pipelines.registration
    voxel, gate = 0.5, 1.0

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Judged:
        moves, stays = (open3d_cloud(one).voxel_down_sample(voxel) for one in (source, target))
        stays.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
        result = registration.registration_icp(
            moves, stays, gate, np.eye(4) if start is None else start.matrix,
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(max_iteration=100),
        )  # fmt: skip
        # It claims nothing; half of the points is what its users often ask for.
        return Pose.from_matrix(result.transformation), result.fitness > 0.5, result.fitness

    return Judge("Open3D ICP to planes: fitness", run)


def kiss_matcher_judge() -> Judge:
    import kiss_matcher

    def run(source: Cloud, target: Cloud, start: Pose | None) -> Judged:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, found.translation
        inliers = matcher.get_num_final_inliers()
        return Pose.from_matrix(matrix), bool(found.valid) and inliers >= _LEAST_INLIERS, inliers

    return Judge("KISS-Matcher: valid, inliers", run)


class Driver:
    """A program of one's own, such as one that uses PCL, and the time it says it took.

    It gets three file names: the target and the source, each float32 x, y, z, 0 a point without a
    header, and the start, four rows of text. It prints the milliseconds from points to pose,
    reading not counted, and the sixteen numbers of target_from_source row by row.
    """

    def __init__(self, command: str) -> None:
        self.words = shlex.split(command)
        self.seconds = 0.0
        self.contender = Contender(Path(self.words[0]).name, self.register)

    def register(self, source: Cloud, target: Cloud, start: Pose | None) -> Claimed:
        with tempfile.TemporaryDirectory() as folder:
            names = [str(Path(folder) / name) for name in ("target.bin", "source.bin", "start.txt")]
            for name, points in zip(names, (target, source), strict=False):
                np.pad(points, ((0, 0), (0, 1))).astype(np.float32).tofile(name)
            np.savetxt(names[2], np.eye(4) if start is None else start.matrix, fmt="%.17g")
            done = subprocess.run([*self.words, *names], capture_output=True, text=True, check=True)
        milliseconds, *numbers = (float(word) for word in done.stdout.split())
        self.seconds = milliseconds / 1e3
        return Pose.from_matrix(np.reshape(numbers, (4, 4))), None


def available(makers: Iterable[Callable[[], _Made]]) -> list[_Made]:
    """Return what can be made here; for the others, print why not."""
    found: list[_Made] = []
    for make in makers:
        try:
            found.append(make())
        except (ImportError, OSError) as error:
            print(f"left out: {error}")
    return found


def with_start(peers: bool) -> list[Contender]:
    found = [ours(name) for name in METHODS]
    if peers:
        found += [small_gicp_peer("GICP"), small_gicp_peer("GICP", 10.0), small_gicp_peer("VGICP")]
    return found


def without_start(peers: bool) -> list[Contender]:
    found = [ours("auto")]
    if peers:
        features = (partial(open3d_features_peer, kind) for kind in ("FGR", "RANSAC"))
        found += available((kiss_matcher_peer, *features))
    return found
