"""Refinement of sparse clouds by planes around their points."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.sparse_refinement import SparseRefinement

_SPACING = 0.27
"""Spacing of the points [units]: that of a sparse cloud in units of its length scale."""

_TRUTH = Pose.from_step(np.array([0.2, -0.1, 0.05, 0.01, -0.01, 0.03]))

_REFINEMENT = SparseRefinement()


def _heights(xy):
    """Return the heights of ridges and ditches, a few spacings wide."""
    x, y = xy.T
    return 0.6 * np.abs((x + 0.3 * y) % 2.0 - 1.0) + 0.5 * np.abs((y - 0.2 * x) % 2.4 - 1.2)


def _ridges(seed, noise=0.02, side=12.0):
    """Return random points of ridges, one for each square of the spacing."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-side / 2.0, side / 2.0, (int((side / _SPACING) ** 2), 2))
    return np.column_stack([xy, _heights(xy) + rng.normal(0.0, noise, len(xy))])


def _prepared(points):
    return _REFINEMENT.prepare(PointCloud.from_array(points))


def _error(pose, source):
    differences = pose.apply(source) - _TRUTH.apply(source)
    return math.sqrt(float((differences**2).sum(axis=1).mean()))


@pytest.fixture(scope="module")
def target():
    return _ridges(1)


@pytest.fixture(scope="module")
def source():
    return _TRUTH.inverse().apply(_ridges(2))


def test_ridges_are_aligned_to_a_tenth_of_their_spacing(target, source):
    start = Pose(np.eye(3), np.zeros(3))
    solution = _REFINEMENT.align(_prepared(target), _prepared(source), start)
    assert solution.reason is StopReason.STEP_SMALL
    assert _error(solution.pose, source) < 0.1 * _SPACING
    assert all(one.pairs for one in solution.history)


def test_it_is_more_accurate_than_cells():
    refined, of_cells = [], []
    fine = FineNdt()
    for seed in range(6):
        target, source = _ridges(seed), _TRUTH.inverse().apply(_ridges(100 + seed))
        clouds = [PointCloud.from_array(one) for one in (target, source)]
        cells = [replace(fine.prepare(one), is_sparse=True) for one in clouds]
        of_cells.append(_error(fine.align(*cells, _TRUTH).pose, source))
        scans = [_REFINEMENT.prepare(one) for one in clouds]
        refined.append(_error(_REFINEMENT.align(*scans, _TRUTH).pose, source))
    assert np.mean(refined) < 0.7 * np.mean(of_cells)


@given(
    st.tuples(*[st.floats(-40.0, 40.0)] * 3),
    st.floats(-math.pi, math.pi),
)
@settings(max_examples=5, deadline=None)
def test_the_result_does_not_depend_on_the_frame_of_the_target(target, source, shift, yaw):
    frame = Pose.from_step(np.array([*shift, 0.0, 0.0, yaw]))
    first = _REFINEMENT.align(_prepared(target), _prepared(source), _TRUTH)
    moved = _REFINEMENT.align(_prepared(frame.apply(target)), _prepared(source), frame @ _TRUTH)
    # The voxels of the downsampling merge other pairs of points.
    difference = _error(frame.inverse() @ moved.pose, source) - _error(first.pose, source)
    assert abs(difference) < 0.03 * _SPACING


def test_exchanged_clouds_give_the_inverse(target, source):
    first = _REFINEMENT.align(_prepared(target), _prepared(source), _TRUTH)
    inverse = _REFINEMENT.align(_prepared(source), _prepared(target), _TRUTH.inverse())
    assert (inverse.pose @ first.pose).is_close(
        Pose.identity(), translation=0.01 * _SPACING, rotation=1e-3
    )


def test_identical_clouds_stay(target):
    scan = _prepared(target)
    solution = _REFINEMENT.align(scan, scan, Pose.identity())
    assert solution.pose.is_close(Pose.identity(), translation=1e-6, rotation=1e-7)


def test_locked_directions_and_a_prior_are_kept(target, source):
    scans = _prepared(target), _prepared(source)
    locked = _REFINEMENT.align(*scans, Pose.identity(), Constraints(dof="xy+yaw"))
    assert locked.pose.translation[2] == pytest.approx(0.0, abs=1e-12)
    assert locked.pose.rotation[2, 2] == pytest.approx(1.0)
    mean = Pose(np.eye(3), np.array([0.1, 0.0, 0.0]))
    prior = PosePrior.from_deviations(mean, 1e-5, 1e-6)
    kept = _REFINEMENT.align(*scans, mean, Constraints(prior=prior))
    assert kept.pose.is_close(mean, translation=1e-3, rotation=1e-4)


def test_clouds_apart_have_no_planes(target, source):
    away = Pose(np.eye(3), np.array([100.0, 0.0, 0.0]))
    solution = _REFINEMENT.align(_prepared(target), _prepared(source), away)
    assert solution.reason is StopReason.EMPTY_OBJECTIVE
    assert solution.pose == away


def test_large_clouds_are_sampled_evenly():
    points = _ridges(3, side=40.0)
    scan = _prepared(points)
    assert len(scan.queries) == _REFINEMENT.max_points < len(scan.tree)
    quadrants = (scan.queries[:, :2] > 0.0) @ [1, 2]
    np.testing.assert_allclose(np.bincount(quadrants) / len(quadrants), 0.25, atol=0.02)


@pytest.mark.parametrize(
    "changed",
    [{"neighbours": 3}, {"max_distance": 0.0}, {"max_points": 0}, {"cauchy_scale": -1.0}],
)
def test_bad_settings_are_refused(changed):
    with pytest.raises(InvalidInput):
        SparseRefinement(**changed)
