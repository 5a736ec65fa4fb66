import numpy as np
import pytest

from reference.wavy_drives import drifting, wavy_drive
from scanlock.errors import InvalidInput
from scanlock.evaluation.alignment import aligned, find_alignment, positions
from scanlock.geometry.pose import Pose

TRUTH = wavy_drive(40)[1]
WORLD = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.3, -0.2, 2.0]))


def _scaled(poses, scale):
    return [WORLD @ Pose(pose.rotation, scale * pose.translation) for pose in poses]


def test_a_scale_is_found_and_removed():
    estimate = _scaled(TRUTH, 1.7)
    found = find_alignment(estimate, TRUTH, "all+scale")
    np.testing.assert_allclose(found.scale, 1.0 / 1.7, rtol=1e-12)
    np.testing.assert_allclose(positions(found.apply(estimate)), positions(TRUTH), atol=1e-9)
    assert find_alignment(estimate, TRUTH, "all").scale == 1.0


def test_the_scale_minimises_the_squared_position_errors():
    estimate = drifting(TRUTH)
    best = find_alignment(estimate, TRUTH, "all+scale")
    centred = positions(best.apply(estimate)) - positions(TRUTH).mean(axis=0)
    around = positions(TRUTH) - positions(TRUTH).mean(axis=0)
    squares = [((factor * centred - around) ** 2).sum() for factor in (0.999, 1.0, 1.001)]
    assert squares[1] < min(squares[0], squares[2])


def test_a_straight_line_fixes_the_scale_and_the_first_poses_the_rest():
    truth = [Pose(np.eye(3), np.array([2.0 * k, 1.0 * k, 0.0])) for k in range(9)]
    estimate = _scaled(truth, 0.5)
    found = find_alignment(estimate, truth, "all+scale")
    np.testing.assert_allclose(found.scale, 2.0, rtol=1e-12)
    for pose, expected in zip(found.apply(estimate), truth, strict=True):
        assert pose.is_close(expected, translation=1e-9, rotation=1e-7)


@pytest.mark.parametrize("alignment", ["none", "first", "all", "all+scale"])
def test_one_pose_is_aligned_without_a_scale(alignment):
    found = find_alignment([WORLD], TRUTH[:1], alignment)
    assert found.scale == 1.0
    [moved] = found.apply([WORLD])
    expected = WORLD if alignment == "none" else TRUTH[0]
    assert moved.is_close(expected, translation=1e-12, rotation=1e-7)


def test_trajectories_of_unequal_length_are_refused():
    with pytest.raises(InvalidInput, match="same number of poses, at least one, got 3 and 2"):
        aligned(TRUTH[:3], TRUTH[:2])
