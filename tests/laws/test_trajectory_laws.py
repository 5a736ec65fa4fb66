"""Laws of trajectory errors, alignments, pairs of poses and matching."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scanlock.evaluation.alignment import Similarity, find_alignment, positions
from scanlock.evaluation.pose_pairs import pose_pairs
from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, compare_axes, in_other_frame
from scanlock.evaluation.trajectory_errors import absolute_errors, kitti_errors, relative_errors
from scanlock.evaluation.trajectory_matching import match_equal, match_times
from scanlock.geometry.pose import Pose

pytestmark = pytest.mark.slow

_seeds = st.integers(0, 2**32 - 1)
_alignments = st.sampled_from(["first", "all", "all+scale"])


def _walk(rng, count, noise=0.3):
    poses = [Pose.from_step(rng.normal(0.0, 1.0, 6))]
    for _ in range(count - 1):
        step = np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.05]) + rng.normal(0.0, noise, 6) * 0.3
        poses.append(poses[-1] @ Pose.from_step(step))
    return poses


def _drawn(seed, count=30):
    rng = np.random.default_rng(seed)
    truth = _walk(rng, count)
    slips = rng.normal(0.0, 0.05, (count, 6))
    estimate = [pose @ Pose.from_step(slip) for pose, slip in zip(truth, slips, strict=True)]
    return rng, estimate, truth


def _assert_same(found, expected):
    np.testing.assert_allclose(found.translations, expected.translations, atol=1e-7)
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=1e-6)


@given(_seeds, _alignments)
def test_aligned_errors_do_not_depend_on_either_world(seed, alignment):
    rng, estimate, truth = _drawn(seed)
    expected = absolute_errors(estimate, truth, alignment)
    here, there = (Pose.from_step(rng.normal(0.0, 5.0, 6)) for _ in range(2))
    moved = [here @ pose for pose in estimate], [there @ pose for pose in truth]
    _assert_same(absolute_errors(*moved, alignment), expected)
    _assert_same(relative_errors(*moved, 3), relative_errors(estimate, truth, 3))


@given(_seeds, st.floats(0.01, 100.0))
def test_errors_with_scale_do_not_depend_on_the_scale_of_the_estimate(seed, scale):
    _, estimate, truth = _drawn(seed)
    resized = Similarity(pose=Pose.identity(), scale=scale).apply(estimate)
    found = absolute_errors(resized, truth, "all+scale")
    _assert_same(found, absolute_errors(estimate, truth, "all+scale"))


@given(_seeds)
def test_more_freedom_of_the_alignment_never_increases_the_rmse(seed):
    _, estimate, truth = _drawn(seed)
    squares = [
        float((absolute_errors(estimate, truth, alignment).translations ** 2).sum())
        for alignment in ("all+scale", "all", "first")
    ]
    assert squares[0] <= squares[1] * (1 + 1e-9) <= squares[2] * (1 + 2e-9)


@given(_seeds)
def test_an_aligned_trajectory_is_aligned_by_the_identity(seed):
    _, estimate, truth = _drawn(seed)
    moved = find_alignment(estimate, truth, "all+scale").apply(estimate)
    again = find_alignment(moved, truth, "all+scale")
    np.testing.assert_allclose(again.scale, 1.0, rtol=1e-9)
    np.testing.assert_allclose(positions(again.apply(moved)), positions(moved), atol=1e-7)


@given(_seeds)
def test_a_change_of_both_sensor_frames_keeps_the_rotation_errors(seed):
    rng, estimate, truth = _drawn(seed)
    mounted = Pose.from_step(rng.normal(0.0, 1.0, 6))
    changed = in_other_frame(estimate, mounted), in_other_frame(truth, mounted)
    found, expected = relative_errors(*changed, 5), relative_errors(estimate, truth, 5)
    np.testing.assert_allclose(found.rotations, expected.rotations, atol=1e-6)
    assert compare_axes(*changed).relation == compare_axes(estimate, truth).relation == "same"


@given(_seeds)
def test_the_camera_frame_is_found_from_either_side(seed):
    rng = np.random.default_rng(seed)
    truth = _walk(rng, 40, noise=0.1)
    camera = in_other_frame(truth, CAMERA_FROM_LASER)
    assert compare_axes(truth, camera).relation == "truth_camera"
    assert compare_axes(camera, truth).relation == "estimate_camera"


@given(_seeds)
def test_kitti_errors_of_a_trajectory_with_itself_are_zero(seed):
    truth = _walk(np.random.default_rng(seed), 150)
    found = kitti_errors(truth, truth)
    assert np.all(found.translations < 1e-9)


_steps = arrays(np.float64, st.integers(1, 40), elements=st.floats(0.0, 3.0))


@given(_steps, st.floats(0.1, 5.0))
def test_chained_pairs_tile_the_path(steps, delta):
    along = np.concatenate([[0.0], np.cumsum(steps)])
    if along[-1] < delta * (1 + 1e-9):
        return
    first, last = pose_pairs(steps, delta, "m")
    assert first[0] == 0
    np.testing.assert_array_equal(first[1:], last[:-1])
    assert np.all(along[last] - along[first] >= delta * (1 - 1e-9))
    assert np.all(along[last - 1] - along[first] < delta * (1 + 1e-9))


_times = arrays(np.float64, st.integers(1, 30), elements=st.floats(0.0, 2.0))


@given(_times, _times, st.floats(0.0, 0.5))
def test_matches_are_close_in_order_and_unique(here, there, limit):
    rows, others = match_times(here, there, limit)
    assert np.all(np.abs(here[rows] - there[others]) <= limit)
    assert len(set(rows)) == len(rows) == len(set(others)) == len(others)
    assert np.all(np.diff(here[rows]) >= 0.0)
    if len(rows) == 0:
        assert np.abs(here[:, None] - there).min() > limit


@given(st.permutations(range(12)), st.permutations(range(4, 20)))
def test_equal_numbers_are_matched_in_the_order_of_the_first(here, there):
    rows, others = match_equal(here, there)
    assert [here[row] for row in rows] == [there[row] for row in others]
    assert [here[row] for row in rows] == [number for number in here if number >= 4]
