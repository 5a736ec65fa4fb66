import numpy as np
import pytest

from reference.samples import gaussians, street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES, CoarseToFine
from scanlock.registration.methods.protocol import InsufficientData, PreparationLog
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.register import register


@pytest.mark.parametrize("score", ["d2d", "p2d"])
def test_the_single_scale_of_the_paper_has_a_small_basin(score):
    paper = SgcNdt(score=score, schedule=CoarseToFine(scales=PAPER_SCALES))
    target = street(1)
    near, far = yaw_pose(0.01, (0.3, 0.0, 0.0)), yaw_pose(2.5, (8.0, 0.0, 0.0))
    for motion, expected in ((near, True), (far, False)):
        result = register(source=motion.inverse().apply(street(2)), target=target, method=paper)
        right = result.target_from_source.is_close(motion, translation=0.15, rotation=0.01)
        assert (right, result.ok) == (expected, expected)


def test_p2d_registers_with_any_voxel_size():
    motion = yaw_pose(0.1, (1.0, 0.0, 0.0))
    source, target = motion.inverse().apply(street(2)), street(1)
    for voxel_size in (0.25, 2.0):
        method = SgcNdt(score="p2d", voxel_size=voxel_size, voxel_size_ratio=0.0)
        result = register(source=source, target=target, method=method)
        assert result.target_from_source.is_close(motion, translation=0.2, rotation=0.01)
        assert result.method == "SgcNdt"


def test_merging_gaussians_hardly_changes_a_smoothed_score():
    clusters = gaussians(np.random.default_rng(3), 500, half_width=20.0)
    for smoothing in (8.0, 4.0):
        merged = clusters.merged(2.0 * smoothing, 0.5)
        assert len(merged) < 0.5 * len(clusters)
        objectives = [
            GaussiansToGaussians(target=one.inflated(smoothing), source=one.inflated(smoothing))
            for one in (clusters, merged)
        ]
        # The weights of each objective are scaled to unit length: compare relative values.
        values = np.array(
            [
                [one.linearise(yaw_pose(0.02 * step, (step, 0.0, 0.0))).value for one in objectives]
                for step in (0.0, 2.0, 4.0, 8.0)
            ]
        )
        np.testing.assert_allclose(*(values / values[0]).T, atol=0.03)


def test_merging_does_not_change_the_pose():
    motion = yaw_pose(0.5, (4.0, 1.0, 0.0))
    source, target = motion.inverse().apply(street(2)), street(1)
    poses = [
        register(source=source, target=target, method=SgcNdt(merge_ratio=ratio)).target_from_source
        for ratio in (0.0, 2.0)
    ]
    assert poses[0].is_close(poses[1], translation=1e-5, rotation=1e-6)


def test_prepared_data_serves_as_target_and_as_source():
    method = SgcNdt()
    log = PreparationLog()
    clusters = method.prepare(PointCloud.from_array(street(1)), log)
    assert log.clusters is clusters
    assert log.notes == list(clusters.notes)
    assert len(clusters.gaussians) == len(method.schedule.scales)
    solution = method.align(clusters, clusters, Pose.identity())
    assert solution.pose == Pose.identity()
    np.testing.assert_allclose(solution.quadratic.gradient, 0.0, atol=1e-6)


def test_too_few_clusters_are_insufficient():
    with pytest.raises(InsufficientData, match="has 0 Gaussians above the ground; 4 are needed"):
        SgcNdt().prepare(PointCloud.from_array(np.eye(3)))


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"voxel_size": 0.0}, "voxel_size must be positive, got 0.0 m"),
        ({"voxel_size_ratio": 1.5}, "voxel_size_ratio must lie between 0 and 1, got 1.5"),
        ({"merge_ratio": -0.5}, "merge_ratio must be at least 0.0, got -0.5"),
        ({"score": "d2p"}, "score must be"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        SgcNdt(**settings)
