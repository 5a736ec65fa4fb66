import itertools

import numpy as np
import pytest

from reference.kitti_metric import segment_errors
from reference.samples import yaw_pose
from scanlock.errors import InvalidInput
from scanlock.evaluation.alignment import aligned
from scanlock.evaluation.trajectory_errors import (
    absolute_errors,
    kitti_errors,
    path_lengths,
    relative_errors,
)
from scanlock.geometry.pose import Pose
from scanlock.io import read_kitti_poses


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
    unaligned = absolute_errors([world @ pose for pose in truth], truth, "none")
    assert unaligned.translations.min() > 1.0


def test_alignment_moves_the_estimate_rigidly():
    truth = _bend(10)
    world = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.3, -0.2, 2.0]))
    moved = aligned([world @ pose for pose in truth], truth, "first")
    for pose, expected in zip(moved, truth, strict=True):
        assert pose.is_close(expected, translation=1e-12, rotation=1e-7)


def test_path_length_is_the_sum_of_the_steps():
    np.testing.assert_allclose(path_lengths(_bend(4, 3.0)), np.hypot(3.0, 0.01) * np.arange(4))
    assert path_lengths([]).shape == (0,)
    np.testing.assert_array_equal(path_lengths(_bend(1)), [0.0])


def test_aligning_all_positions_minimises_the_squared_errors():
    truth = _bend()
    rng = np.random.default_rng(0)
    noisy = [Pose(p.rotation, p.translation + rng.normal(0.0, 0.1, 3)) for p in truth]
    squares = [
        (absolute_errors(noisy, truth, alignment).translations ** 2).sum()
        for alignment in ("all", "first", "none")
    ]
    assert squares[0] < min(squares[1:])


def test_alignment_of_a_straight_drive_adds_no_rotation_about_its_line():
    rng = np.random.default_rng(3)
    direction = np.array([1.0, 2.0, 0.3])
    truth = [Pose(np.eye(3), k * direction) for k in range(30)]
    world = Pose.from_step(rng.normal(0.0, 1.0, 6))
    found = absolute_errors([world @ pose for pose in truth], truth, "all")
    assert found.rotations.max() < 1e-7
    assert found.translations.max() < 1e-9


def _wandering(seed, count, step):
    rng = np.random.default_rng(seed)
    poses = [Pose.identity()]
    for _ in range(count - 1):
        turn = rng.normal(0.0, 0.03, 3) * [0.1, 0.1, 1.0]
        move = rng.normal([step, 0.0, 0.0], 0.05)
        poses.append(poses[-1] @ Pose.from_step(np.concatenate([move, turn])))
    return poses


def _drifting(truth, seed):
    rng = np.random.default_rng(seed)
    poses = [truth[0]]
    for before, after in itertools.pairwise(truth):
        slip = Pose.from_step(rng.normal(0.0, 0.002, 6))
        poses.append(poses[-1] @ before.inverse() @ after @ slip)
    return poses


def _assert_matches_the_reference(estimate, truth):
    found = kitti_errors(estimate, truth)
    slow = segment_errors([pose.matrix for pose in estimate], [pose.matrix for pose in truth])
    assert len(slow) > 10
    expected = np.array(slow)
    np.testing.assert_array_equal(found.first, expected[:, 0])
    np.testing.assert_array_equal(found.last, expected[:, 1])
    np.testing.assert_allclose(found.translations / found.lengths, expected[:, 2], rtol=1e-9)
    np.testing.assert_allclose(found.rotations / found.lengths, expected[:, 3], rtol=1e-6)


def test_kitti_errors_agree_with_the_reference():
    truth = _wandering(0, 300, 1.3)
    _assert_matches_the_reference(_drifting(truth, 1), truth)


@pytest.mark.data
def test_kitti_errors_agree_with_the_reference_on_a_benchmark_drive(scan_data):
    truth = read_kitti_poses(scan_data / "trajectories" / "kitti_ground_truth" / "04.txt")
    _assert_matches_the_reference(_drifting(truth, 2), truth)


def test_one_wrong_motion_gives_one_relative_error():
    truth = _bend()
    slip = yaw_pose(0.1, (0.5, 0.0, 0.0))
    at = 20
    estimate = truth[:at] + [truth[at - 1] @ slip @ truth[at - 1].inverse() @ p for p in truth[at:]]
    found = relative_errors(estimate, truth)
    wrong = np.flatnonzero(found.translations > 1e-9)
    np.testing.assert_array_equal(wrong, [at - 1])
    np.testing.assert_allclose(found.rotations[at - 1], 0.1, rtol=1e-9)
    np.testing.assert_allclose(found.lengths, np.hypot(1.0, 0.01))


def test_kitti_errors_of_a_scaled_trajectory_equal_its_scale_error():
    truth = [Pose(np.eye(3), np.array([2.0 * k, 0.0, 0.0])) for k in range(500)]
    estimate = [Pose(np.eye(3), 1.01 * pose.translation) for pose in truth]
    found = kitti_errors(estimate, truth)
    assert set(found.lengths) == {100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0}
    np.testing.assert_array_equal(np.unique(found.first % 10), [0])
    # A segment ends at the first pose beyond its length, here one step of 2 m farther.
    np.testing.assert_allclose(found.translations, 0.01 * (found.lengths + 2.0), rtol=1e-9)
    assert len(kitti_errors(truth[:40], truth[:40])) == 0


def test_kitti_rotation_errors_grow_with_path_length():
    truth = [Pose(np.eye(3), np.array([1.0 * k, 0.0, 0.0])) for k in range(202)]
    drifting = [yaw_pose(1e-4 * k, tuple(p.translation)) for k, p in enumerate(truth)]
    found = kitti_errors(drifting, truth)
    assert len(found) > 0
    np.testing.assert_allclose(found.rotations, 1e-4 * (found.last - found.first), rtol=1e-6)


def test_trajectories_of_unequal_length_are_refused():
    with pytest.raises(InvalidInput, match="the same number of poses, at least one, got 3 and 2"):
        absolute_errors(_bend(3), _bend(2))
    with pytest.raises(InvalidInput, match="got 0 and 0"):
        kitti_errors([], [])
    with pytest.raises(InvalidInput, match=r"delta \[scans\] must be below .*, 2, got 3"):
        relative_errors(_bend(3), _bend(3), 3)


def test_motions_of_a_fixed_time_need_times_and_follow_them():
    truth = _bend(5)
    times = np.array([0.0, 1.0, 1.5, 2.0, 9.0])
    found = relative_errors(truth, truth, 1.0, "s", times=times)
    assert list(zip(found.first, found.last, strict=True)) == [(0, 1), (1, 3), (3, 4)]
    with pytest.raises(InvalidInput, match="times must be given for a delta in seconds"):
        relative_errors(truth, truth, 1.0, "s")
    with pytest.raises(InvalidInput, match="times must ascend"):
        relative_errors(truth, truth, 1.0, "s", times=times[::-1])
