import math

import numpy as np
import pytest

from reference.samples import street
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.verification.features import extract_features
from scanlock.registration.verification.refinement import refine_pose


def _evidence(points):
    return extract_features(PointCloud.from_array(points))


_TRUTH = Pose(exp_rotation(np.array([0.0, 0.0, 0.2])), [1.0, -0.5, 0.1])


@pytest.fixture(scope="module")
def scans():
    return _evidence(street(1)), _evidence(_TRUTH.inverse().apply(street(2)))


@pytest.mark.parametrize(
    "step",
    [[0.0] * 6, [0.2, 0.1, 0.05, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0, 0.02]],
    ids=["exact", "shifted", "turned"],
)
def test_the_drift_is_how_far_a_pose_is_off(scans, step):
    off = _TRUTH.retract(np.array(step))
    metres, radians = off.distance(_TRUTH)
    expected = math.hypot(metres, 0.3 * math.degrees(radians))
    assert refine_pose(*scans, off).refinement_shift == pytest.approx(expected, abs=0.06)


def test_what_is_left_at_rest_does_not_depend_on_where_it_began(scans):
    exact, off = (
        refine_pose(*scans, _TRUTH.retract(np.array([shift, 0.0, 0.0, 0.0, 0.0, 0.0])))
        for shift in (0.0, 0.25)
    )
    assert off.surface.outlier_ratio == pytest.approx(exact.surface.outlier_ratio, abs=0.05)
    assert off.forward.outlier_ratio > 3.0 * exact.forward.outlier_ratio


def test_a_scan_of_another_place_comes_to_no_rest_that_fits(scans):
    other = _evidence(street(7) @ exp_rotation(np.array([0.0, 0.0, 1.3])).T + [30.0, 40.0, 0.0])
    found = refine_pose(scans[0], other, Pose(np.eye(3), [-30.0, -40.0, 0.0]))
    right = refine_pose(*scans, _TRUTH)
    assert found.surface.outlier_ratio > 3.0 * right.surface.outlier_ratio


def test_without_planes_there_is_no_drift(scans):
    away = Pose(np.eye(3), [500.0, 0.0, 0.0])
    found = refine_pose(*scans, away)
    assert found.observability is None
    assert math.isnan(found.refinement_shift)


def test_nothing_slides_along_what_nothing_holds():
    rng = np.random.default_rng(0)
    ground = np.column_stack([rng.uniform(-8.0, 8.0, (6000, 2)), 0.01 * rng.normal(size=6000)])
    field = _evidence(ground)
    found = refine_pose(field, field, Pose(np.eye(3), [0.3, 0.0, 0.05]))
    assert found.refinement_shift == pytest.approx(0.05, abs=0.02)
