"""Other libraries as contenders, where they are installed."""

import shlex
import subprocess
import tempfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from benchmarks._common.contenders import Cloud, Contender, PoseAndClaim, scanlock_contender
from scanlock.geometry.pose import Pose
from scanlock.registration.registry import METHODS

_Made = TypeVar("_Made")

_FEATURE_VOXEL = 0.5
"""Voxel size of Open3D's features [m]. Radii: 2 voxels for normals, 5 for features."""

_ICP_VOXELS = (1.0, 0.5, 0.25)
"""Voxel sizes of Open3D's multi-scale ICP [m]; correspondences within 2 voxels."""

_MIN_INLIERS = 5
"""Minimum number of final inliers of KISS-Matcher, from its own example."""


def small_gicp_peer(kind: str, max_distance: float = 1.0, threads: int = 1) -> Contender:
    """Return "GICP" or "VGICP" of small_gicp, with the downsampling of its example."""
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        result = small_gicp.align(
            target,
            source,
            init_T_target_source=np.eye(4) if start is None else start.matrix,
            registration_type=kind,
            downsampling_resolution=0.25,
            max_correspondence_distance=max_distance,
            num_threads=threads,
            max_iterations=100,
        )
        # Its matrix can differ from a rotation by more than rounding; from_matrix corrects that.
        return Pose.from_matrix(result.T_target_source), bool(result.converged)

    return Contender(f"small_gicp {kind}, {max_distance:g} m", run)


def kiss_icp_peer(threads: int = 1) -> Contender:
    """Return KISS-ICP with default settings and a local map made of the target."""
    from kiss_icp.config import load_config
    from kiss_icp.kiss_icp import KissICP

    config = load_config(None)
    config.data.deskew = False
    config.registration.max_num_threads = threads

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        odometry = KissICP(config)
        none = np.zeros(0)
        sides = (odometry.preprocessor.preprocess(one, none, np.eye(4)) for one in (target, source))
        (_, map_points), (points, _) = (odometry.voxelize(side) for side in sides)
        odometry.local_map.update(map_points, np.eye(4))
        sigma = odometry.adaptive_threshold.get_threshold()
        matrix = odometry.registration.align_points_to_map(
            points, odometry.local_map, np.eye(4) if start is None else start.matrix,
            3.0 * sigma, sigma,
        )  # fmt: skip
        return Pose.from_matrix(matrix), None

    return Contender("KISS-ICP", run)


def open3d_icp_peer() -> Contender:
    """Return point-to-plane ICP of Open3D at three voxel sizes."""
    import open3d

    registration = open3d.pipelines.registration

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        clouds = open3d_cloud(source), open3d_cloud(target)
        matrix = np.eye(4) if start is None else start.matrix
        for voxel in _ICP_VOXELS:
            coarse_source, coarse_target = (cloud.voxel_down_sample(voxel) for cloud in clouds)
            coarse_target.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
            matrix = registration.registration_icp(
                coarse_source, coarse_target, 2.0 * voxel, matrix,
                registration.TransformationEstimationPointToPlane(),
            ).transformation  # fmt: skip
        return Pose.from_matrix(matrix), None

    return Contender("Open3D ICP to planes, 3 scales", run)


def open3d_features_peer(kind: str) -> Contender:
    """Return "FGR" or "RANSAC" of Open3D on FPFH features, followed by point-to-plane ICP."""
    import open3d

    features = open3d.pipelines.registration
    voxel = _FEATURE_VOXEL

    def downsampled(points: Cloud) -> tuple[Any, Any]:
        cloud = open3d_cloud(points).voxel_down_sample(voxel)
        cloud.estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
        around = open3d.geometry.KDTreeSearchParamHybrid(5.0 * voxel, 100)
        return cloud, features.compute_fpfh_feature(cloud, around)

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        (coarse_source, own), (coarse_target, other) = map(downsampled, (source, target))
        if kind == "FGR":
            option = features.FastGlobalRegistrationOption(maximum_correspondence_distance=voxel)
            first = features.registration_fgr_based_on_feature_matching(
                coarse_source, coarse_target, own, other, option
            )
        else:
            first = features.registration_ransac_based_on_feature_matching(
                coarse_source, coarse_target, own, other, True, 1.5 * voxel,
                features.TransformationEstimationPointToPoint(False), 3,
                [
                    features.CorrespondenceCheckerBasedOnEdgeLength(0.9),
                    features.CorrespondenceCheckerBasedOnDistance(1.5 * voxel),
                ],
                features.RANSACConvergenceCriteria(100_000, 0.999),
            )  # fmt: skip
        final = features.registration_icp(
            coarse_source, coarse_target, 2.0 * voxel, first.transformation,
            features.TransformationEstimationPointToPlane(),
        )  # fmt: skip
        return Pose.from_matrix(final.transformation), None

    return Contender(f"Open3D {kind} + ICP", run)


def open3d_cloud(points: Cloud) -> Any:
    """Return an array as a cloud of Open3D."""
    import open3d

    # Open3D refuses read-only arrays.
    return open3d.geometry.PointCloud(open3d.utility.Vector3dVector(np.array(points)))


def kiss_matcher_peer(threads: int = 1) -> Contender:
    """Return KISS-Matcher at voxels of 0.3 m, followed by G-ICP of small_gicp."""
    import kiss_matcher

    fine = small_gicp_peer("GICP", threads=threads)

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        rough = np.eye(4)
        rough[:3, :3], rough[:3, 3] = found.rotation, found.translation
        pose, converged = fine.register(source, target, Pose.from_matrix(rough))
        return pose, bool(matcher.get_num_final_inliers() >= _MIN_INLIERS and converged)

    return Contender("KISS-Matcher + small_gicp GICP", run)


PoseClaimScore = tuple[Pose, bool, float]
"""A pose, whether the library reports it as valid, and the score behind that; larger is better."""


@dataclass(frozen=True)
class ScoredPeer:
    """A library with the score that it offers for its own result."""

    name: str
    register: Callable[[Cloud, Cloud, Pose | None], PoseClaimScore]


def small_gicp_scored() -> ScoredPeer:
    """Return G-ICP of small_gicp with its convergence flag and its inlier ratio."""
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseClaimScore:
        fine_target, tree = small_gicp.preprocess_points(target, downsampling_resolution=0.25)
        fine_source, _ = small_gicp.preprocess_points(source, downsampling_resolution=0.25)
        result = small_gicp.align(
            fine_target, fine_source, tree, np.eye(4) if start is None else start.matrix,
            registration_type="GICP", max_correspondence_distance=1.0, max_iterations=100,
        )  # fmt: skip
        inliers = result.num_inliers / max(1, fine_source.size())
        return Pose.from_matrix(result.T_target_source), bool(result.converged), inliers

    return ScoredPeer("small_gicp GICP: converged, inliers", run)


def open3d_scored() -> ScoredPeer:
    """Return point-to-plane ICP of Open3D with its fitness."""
    import open3d

    registration = open3d.pipelines.registration
    voxel, max_distance = 0.5, 1.0

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseClaimScore:
        coarse = [open3d_cloud(one).voxel_down_sample(voxel) for one in (source, target)]
        coarse[1].estimate_normals(open3d.geometry.KDTreeSearchParamHybrid(2.0 * voxel, 30))
        result = registration.registration_icp(
            coarse[0], coarse[1], max_distance, np.eye(4) if start is None else start.matrix,
            registration.TransformationEstimationPointToPlane(),
            registration.ICPConvergenceCriteria(max_iteration=100),
        )  # fmt: skip
        # Open3D reports no validity; a fitness above 0.5 is a common threshold.
        return Pose.from_matrix(result.transformation), result.fitness > 0.5, result.fitness

    return ScoredPeer("Open3D ICP to planes: fitness", run)


def kiss_matcher_scored() -> ScoredPeer:
    """Return KISS-Matcher with its validity flag and its number of inliers."""
    import kiss_matcher

    def run(source: Cloud, target: Cloud, start: Pose | None) -> PoseClaimScore:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, found.translation
        inliers = matcher.get_num_final_inliers()
        return Pose.from_matrix(matrix), bool(found.valid) and inliers >= _MIN_INLIERS, inliers

    return ScoredPeer("KISS-Matcher: valid, inliers", run)


class ExternalProgram:
    """A contender that is a program, such as one built on PCL, with the time that it prints.

    Arguments of the program: three file names, the target and the source (float32 x, y, z, 0 per
    point, no header) and the start (four rows of text). Output: the milliseconds from points to
    pose without reading, and the sixteen numbers of target_from_source row by row.
    """

    def __init__(self, command: str) -> None:
        self.words = shlex.split(command)
        self.seconds = 0.0
        self.contender = Contender(Path(self.words[0]).name, self.register)

    def register(self, source: Cloud, target: Cloud, start: Pose | None) -> PoseAndClaim:
        """Run the program once; `seconds` then holds its time."""
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
    """Return the peers that are installed; print the import error of the others."""
    found: list[_Made] = []
    for make in makers:
        try:
            found.append(make())
        except (ImportError, OSError) as error:
            print(f"not installed: {error}")
    return found


def contenders_with_start(peers: bool) -> list[Contender]:
    """Return every method of scanlock and, on request, the peers that need a start."""
    found = [scanlock_contender(name) for name in METHODS]
    if peers:
        found += [small_gicp_peer("GICP"), small_gicp_peer("GICP", 10.0), small_gicp_peer("VGICP")]
    return found


def contenders_without_start(peers: bool) -> list[Contender]:
    """Return the default method and, on request, the global registrations of the peers."""
    found = [scanlock_contender("auto")]
    if peers:
        features = (partial(open3d_features_peer, kind) for kind in ("FGR", "RANSAC"))
        found += available((kiss_matcher_peer, *features))
    return found
