import math

import numpy as np
import pytest

from reference.point_tree import distances
from reference.samples import street, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.evaluation.closest_distances import closest_distances, inlier_mean


def test_distances_agree_with_brute_force_in_source_order():
    target, source = street(1, 300), street(2, 200)
    pose = yaw_pose(0.3, (1.0, -2.0, 0.1))
    expected = distances(target, pose.apply(source)).min(axis=1)
    np.testing.assert_allclose(closest_distances(target, source, pose), expected, atol=1e-12)


def test_inlier_mean_excludes_distances_beyond_three_deviations():
    values = np.array([0.1, 0.2] * 50 + [9.0])
    assert values.mean() + 3.0 * values.std() < 9.0
    assert inlier_mean(values) == pytest.approx(0.15)
    assert inlier_mean(values[:-1]) == pytest.approx(0.15)


def test_the_mean_of_no_distances_is_nan_and_an_empty_target_is_refused():
    assert math.isnan(inlier_mean(np.zeros(0)))
    with pytest.raises(InvalidInput, match="at least one point"):
        closest_distances(np.zeros((0, 3)), np.zeros((3, 3)), yaw_pose(0.0, (0.0, 0.0, 0.0)))
