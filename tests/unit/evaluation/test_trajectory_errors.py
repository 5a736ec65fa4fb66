import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.errors import InvalidInput
from scanlock.evaluation.trajectory_errors import absolute_errors, kitti_errors, relative_errors
from scanlock.geometry.pose import Pose


def _bend(count=50, step=1.0):
    poses = [Pose.identity()]
    for _ in range(count - 1):
        poses.append(poses[-1] @ yaw_pose(0.02, (step, 0.0, 0.01)))
    return poses


def test_a_trajectory_has_no_error_against_itself():
    truth = _bend()
    for found in (absolute_errors(truth, truth), relative_errors(truth, truth, 5)):
        assert found.translations.max() < 1e-12
        assert found.rotations.max() < 1e-7


@pytest.mark.parametrize("alignment", ["first", "all"])
def test_another_world_frame_is_aligned_away(alignment):
    truth = _bend()
    world = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.3, -0.2, 2.0]))
    found = absolute_errors([world @ pose for pose in truth], truth, alignment)
    assert found.translations.max() < 1e-9
    assert found.rotations.max() < 1e-7
    apart = absolute_errors([world @ pose for pose in truth], truth, "none")
    assert apart.translations.min() > 1.0


def test_aligning_all_positions_leaves_the_least_squares():
    truth = _bend()
    rng = np.random.default_rng(0)
    noisy = [Pose(p.rotation, p.translation + rng.normal(0.0, 0.1, 3)) for p in truth]
    squares = [
        (absolute_errors(noisy, truth, alignment).translations ** 2).sum()
        for alignment in ("all", "first", "none")
    ]
    assert squares[0] < min(squares[1:])


def test_relative_errors_see_one_wrong_step_once():
    truth = _bend()
    slip = yaw_pose(0.1, (0.5, 0.0, 0.0))
    at = 20
    estimate = truth[:at] + [truth[at - 1] @ slip @ truth[at - 1].inverse() @ p for p in truth[at:]]
    found = relative_errors(estimate, truth)
    wrong = np.flatnonzero(found.translations > 1e-9)
    np.testing.assert_array_equal(wrong, [at - 1])
    np.testing.assert_allclose(found.rotations[at - 1], 0.1, rtol=1e-9)
    np.testing.assert_allclose(found.lengths, np.hypot(1.0, 0.01))


def test_kitti_errors_of_a_scaled_drive_are_its_scale():
    truth = [Pose(np.eye(3), np.array([2.0 * k, 0.0, 0.0])) for k in range(500)]
    estimate = [Pose(np.eye(3), 1.01 * pose.translation) for pose in truth]
    found = kitti_errors(estimate, truth)
    assert set(found.lengths) == {100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0}
    np.testing.assert_array_equal(np.unique(found.first % 10), [0])
    # A length ends at the first pose beyond it: one step of 2 m farther here.
    np.testing.assert_allclose(found.translations, 0.01 * (found.lengths + 2.0), rtol=1e-9)
    assert len(kitti_errors(truth[:40], truth[:40])) == 0


def test_kitti_turns_are_counted_by_the_metre():
    truth = [Pose(np.eye(3), np.array([1.0 * k, 0.0, 0.0])) for k in range(202)]
    drift = [yaw_pose(1e-4 * k, tuple(p.translation)) for k, p in enumerate(truth)]
    found = kitti_errors(drift, truth)
    np.testing.assert_allclose(found.rotations, 1e-4 * (found.last - found.first), rtol=1e-6)


def test_trajectories_that_do_not_fit_together_are_refused():
    with pytest.raises(InvalidInput, match="as many poses, at least one, got 3 and 2"):
        absolute_errors(_bend(3), _bend(2))
    with pytest.raises(InvalidInput, match="got 0 and 0"):
        kitti_errors([], [])
    with pytest.raises(InvalidInput, match="apart must be below the 3 poses"):
        relative_errors(_bend(3), _bend(3), 3)
