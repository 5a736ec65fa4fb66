import numpy as np
import pytest

from reference.samples import gaussians, street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.methods.coarse_to_fine import PAPER_SCALES, CoarseToFine
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.register import register


@pytest.mark.parametrize("score", ["d2d", "p2d"])
def test_the_single_scale_of_the_paper_works_from_near_and_not_from_far(score):
    paper = SgcNdt(score=score, schedule=CoarseToFine(scales=PAPER_SCALES))
    target = street(1)
    near, far = yaw_pose(0.01, (0.3, 0.0, 0.0)), yaw_pose(2.5, (8.0, 0.0, 0.0))
    for motion, expected in ((near, True), (far, False)):
        result = register(source=motion.inverse().apply(street(2)), target=target, method=paper)
        right = result.target_from_source.is_close(motion, translation=0.15, rotation=0.01)
        assert (right, result.ok) == (expected, expected)


def test_points_of_p2d_are_thinned_by_the_spacing():
    motion = yaw_pose(0.1, (1.0, 0.0, 0.0))
    source, target = motion.inverse().apply(street(2)), street(1)
    for spacing in (0.25, 2.0):
        method = SgcNdt(score="p2d", voxel_size=spacing, voxel_size_ratio=0.0)
        result = register(source=source, target=target, method=method)
        assert result.target_from_source.is_close(motion, translation=0.2, rotation=0.01)
        assert result.method == "SgcNdt"


def test_a_blurred_score_is_much_the_same_with_merged_gaussians():
    parts = gaussians(np.random.default_rng(3), 500, spread=20.0)
    for blur in (8.0, 4.0):
        merged = parts.merged(2.0 * blur, 0.5)
        assert len(merged) < 0.5 * len(parts)
        apart = [
            GaussiansToGaussians(target=one.inflated(blur), source=one.inflated(blur))
            for one in (parts, merged)
        ]
        # Weights are scaled to unit length on their own, so values compare to the best one.
        values = np.array(
            [
                [one.linearise(yaw_pose(0.02 * step, (step, 0.0, 0.0))).value for one in apart]
                for step in (0.0, 2.0, 4.0, 8.0)
            ]
        )
        np.testing.assert_allclose(*(values / values[0]).T, atol=0.03)


def test_merging_changes_the_way_and_not_the_end():
    motion = yaw_pose(0.5, (4.0, 1.0, 0.0))
    source, target = motion.inverse().apply(street(2)), street(1)
    ends = [
        register(source=source, target=target, method=SgcNdt(merge_ratio=share)).target_from_source
        for share in (0.0, 2.0)
    ]
    assert ends[0].is_close(ends[1], translation=1e-5, rotation=1e-6)


def test_a_scan_is_prepared_without_knowing_its_role():
    method = SgcNdt()
    marks = method.prepare(PointCloud.from_array(street(1)))
    assert len(marks.gaussians) == len(method.schedule.scales)
    solution = method.align(marks, marks, Pose.identity())
    assert solution.pose == Pose.identity()
    np.testing.assert_allclose(solution.quadratic.gradient, 0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"spacing": 0.0}, "spacing must be positive, got 0.0 m"),
        ({"spacing_share": 1.5}, "spacing_share must lie between 0 and 1, got 1.5"),
        ({"merge_share": -0.5}, "merge_share must be at least 0.0, got -0.5"),
        ({"score": "d2p"}, "score must be"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(settings, message):
    with pytest.raises(InvalidInput, match=message):
        SgcNdt(**settings)
