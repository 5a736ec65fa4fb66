import math

import numpy as np
import pytest

from reference.samples import street
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.verification.features import extract_features
from scanlock.registration.verification.refinement import refine_pose


def _features(points):
    return extract_features(PointCloud.from_array(points))


_TRUTH = Pose(exp_rotation(np.array([0.0, 0.0, 0.2])), [1.0, -0.5, 0.1])


@pytest.fixture(scope="module")
def scans():
    return _features(street(1)), _features(_TRUTH.inverse().apply(street(2)))


@pytest.mark.parametrize(
    "step",
    [[0.0] * 6, [0.2, 0.1, 0.05, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.02]],
    ids=["exact", "shifted", "rotated"],
)
def test_the_refinement_shift_is_the_error_of_the_pose(scans, step):
    pose = _TRUTH.retract(np.array(step))
    metres, radians = pose.distance(_TRUTH)
    expected = math.hypot(metres, 0.3 * math.degrees(radians))
    assert refine_pose(*scans, pose).refinement_shift == pytest.approx(expected, abs=0.06)


def test_the_outlier_ratio_after_refinement_does_not_depend_on_the_error_of_the_pose(scans):
    exact, shifted = (
        refine_pose(*scans, _TRUTH.retract(np.array([shift, 0.0, 0.0, 0.0, 0.0, 0.0])))
        for shift in (0.0, 0.25)
    )
    refined_ratio = exact.refined_planes.outlier_ratio
    assert shifted.refined_planes.outlier_ratio == pytest.approx(refined_ratio, abs=0.05)
    assert shifted.target_planes.outlier_ratio > 3.0 * exact.target_planes.outlier_ratio


def test_refinement_leaves_large_residuals_for_another_place(scans):
    other = _features(street(7) @ exp_rotation(np.array([0.0, 0.0, 1.3])).T + [30.0, 40.0, 0.0])
    wrong = refine_pose(scans[0], other, Pose(np.eye(3), [-30.0, -40.0, 0.0]))
    correct = refine_pose(*scans, _TRUTH)
    assert wrong.refined_planes.outlier_ratio > 3.0 * correct.refined_planes.outlier_ratio


def test_the_refinement_shift_is_unknown_without_planes(scans):
    found = refine_pose(*scans, Pose(np.eye(3), [500.0, 0.0, 0.0]))
    assert found.observability is None
    assert math.isnan(found.refinement_shift)


def test_refinement_does_not_move_along_unconstrained_directions():
    rng = np.random.default_rng(0)
    ground = np.column_stack([rng.uniform(-8.0, 8.0, (6000, 2)), 0.01 * rng.normal(size=6000)])
    field = _features(ground)
    found = refine_pose(field, field, Pose(np.eye(3), [0.3, 0.0, 0.05]))
    assert found.refinement_shift == pytest.approx(0.05, abs=0.02)
