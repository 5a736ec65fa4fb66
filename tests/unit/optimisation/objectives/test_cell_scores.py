from functools import cache

import numpy as np
import pytest

from reference import cells as reference
from reference import differences
from reference.gaussian_scores import p2d_value
from scanlock.arrays import read_only
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.voxel_gaussians import VoxelGrid
from scanlock.optimisation.objectives.cell_scores import CELL_ASSOCIATIONS, PointsToCells
from scanlock.optimisation.objectives.gaussian_scores import PointsToGaussians, ScoreShape

_WIDTH = 1.5
_CENTRE = np.array([4.0, -2.0, 0.0])

_each_association = pytest.mark.parametrize("association", CELL_ASSOCIATIONS)


def _voxels(seed, offset=0.25):
    rng = np.random.default_rng(seed)
    points = rng.normal(0.0, [3.0, 2.5, 0.7], (900, 3)) + _CENTRE
    return VoxelGrid(min_deviation=0.1, offset=offset).gaussians(points, _WIDTH)


def _points(seed, count=60):
    rng = np.random.default_rng(100 + seed)
    return read_only(rng.normal(0.0, [3.0, 2.5, 1.2], (count, 3)) + _CENTRE)


def _away_from_faces(pose, points, voxels, margin):
    """Points whose cells, and surrounding cell centres, are the same within a margin [m].

    Their distances from the means also differ from the cell size by more than the margin.
    """
    moved = pose.apply(points)
    phases = np.mod((moved - voxels.corner) / voxels.size, 0.5) * voxels.size
    inside = ((phases > margin) & (phases < 0.5 * voxels.size - margin)).all(axis=1)
    distances = np.linalg.norm(moved[:, None] - voxels.gaussians.means, axis=2)
    inside &= (np.abs(distances - voxels.size) > margin).all(axis=1)
    return read_only(points[inside])


@pytest.mark.slow
@_each_association
@pytest.mark.parametrize("seed", range(3))
def test_values_match_the_definition(association, seed):
    voxels, points = _voxels(seed), _points(seed)
    pose = Pose.from_step(0.2 * np.random.default_rng(seed).normal(size=6))
    shape = ScoreShape(sharpness=0.3, height=2.5)
    objective = PointsToCells(target=voxels, points=points, association=association, shape=shape)
    expected = reference.value(pose, voxels, points, association, height=2.5, sharpness=0.3)
    assert expected < -0.05
    np.testing.assert_allclose(objective.linearise(pose).value, expected, rtol=1e-11)
    assert objective.count == len(points)


@_each_association
@pytest.mark.parametrize("seed", range(3))
def test_derivatives_agree_with_differences_inside_a_cell(association, seed):
    voxels = _voxels(seed)
    pose = Pose.from_step(0.2 * np.random.default_rng(seed).normal(size=6))
    points = _away_from_faces(pose, _points(seed, 400), voxels, 0.05)
    assert len(points) > 20
    # A window that falls where the score is large.
    shape = ScoreShape(sharpness=0.5, height=3.0, window_start=0.5, window_end=8.0)
    objective = PointsToCells(target=voxels, points=points, association=association, shape=shape)
    found = objective.linearise(pose)
    h = 2e-4 * np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1])
    gradient = differences.gradient(lambda p: objective.linearise(p).value, pose, h)
    hessian = differences.hessian(lambda p: objective.linearise(p).gradient, pose, h)
    scale = np.abs(hessian).max()
    assert np.abs(found.gradient).max() > 1e-2
    # The third derivative of the window jumps. A point that passes a jump within the stencil adds
    # h times the jump to the difference of gradients.
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-6, atol=1e-7 * scale)
    np.testing.assert_allclose(found.hessian, hessian, rtol=1e-5, atol=1e-6 * scale)


@pytest.mark.slow
@pytest.mark.parametrize("association", ["own-cell", "seven-cells", "trilinear"])
def test_the_convex_hessian_is_the_gauss_newton_hessian(association):
    voxels, points = _voxels(7), _points(7)
    pose = Pose.from_step(0.1 * np.random.default_rng(7).normal(size=6))
    exact, convex = (
        PointsToCells(
            target=voxels, points=points, association=association, curvature=curvature
        ).linearise(pose)
        for curvature in ("exact", "convex")
    )
    np.testing.assert_array_equal(convex.gradient, exact.gradient)
    expected = reference.convex_hessian(pose, voxels, points, association)
    np.testing.assert_allclose(convex.hessian, expected, rtol=1e-6, atol=1e-7)
    assert np.linalg.eigvalsh(convex.hessian)[0] > -1e-9
    assert np.linalg.eigvalsh(exact.hessian)[0] < -1e-3


@cache
def _values_along(association):
    """Values for one point that moves along x through three cells, past faces, centres and means.

    Those of the sum over all Gaussians if `association` is None.
    """
    voxels = _voxels(3, offset=0.0)
    point = read_only(np.array([[0.0, -2.0, 0.3]]))
    # A smooth score, whose slopes are small beside the jumps.
    shape = ScoreShape(sharpness=0.2)
    if association is None:
        objective = PointsToGaussians(target=voxels.gaussians, points=point, shape=shape)
    else:
        objective = PointsToCells(target=voxels, points=point, association=association, shape=shape)
    poses = (Pose(np.eye(3), np.array([x, 0.0, 0.0])) for x in np.arange(2.0, 5.5, 2e-4))
    return np.array([objective.linearise(pose).value for pose in poses])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("association", "jump"),
    [("own-cell", 0.1), ("seven-cells", 0.01), ("near-cells", 0.01), ("trilinear", 0.0)],
)
def test_the_value_jumps_where_a_point_changes_its_cells(association, jump):
    own, every = _values_along(association), _values_along(None)
    # The maximum slope of a sum of these Gaussians and of its weights, times the step.
    smooth = 27.0 * (np.sqrt(0.2) * np.exp(-0.5) / 0.1 + 3.0 / _WIDTH) * 2e-4
    assert np.abs(np.diff(every)).max() < smooth
    if jump:
        assert np.abs(np.diff(own)).max() > max(jump, 5.0 * np.abs(np.diff(every)).max())
    else:
        assert np.abs(np.diff(own)).max() < smooth


def test_trilinear_weights_sum_to_one():
    # Eight cells with the same Gaussian score as one.
    rng = np.random.default_rng(4)
    lattice = np.indices((2, 2, 2)).reshape(3, 8).T + 0.5
    points = np.concatenate([centre + 0.01 * rng.normal(size=(40, 3)) for centre in lattice])
    voxels = VoxelGrid(min_deviation=1e4).gaussians(points, 1.0)
    assert len(voxels) == 8
    inside = read_only(rng.uniform(0.5, 1.5, (50, 3)))
    found = PointsToCells(target=voxels, points=inside, association="trilinear")
    np.testing.assert_allclose(found.linearise(Pose.identity()).value, -1.0, atol=1e-6)


def test_scores_over_some_cells_are_weaker_than_over_all():
    voxels, points = _voxels(5), _points(5)
    pose = Pose.identity()
    values = {
        association: PointsToCells(target=voxels, points=points, association=association)
        .linearise(pose)
        .value
        for association in CELL_ASSOCIATIONS
    }
    every = p2d_value(pose, voxels.gaussians, points)
    # Each association scores a subset of the Gaussians.
    assert every < values["near-cells"] < values["own-cell"]
    assert every < values["seven-cells"] < values["own-cell"]
    assert every < values["trilinear"] < 0.0


@_each_association
def test_scans_without_overlap_give_a_zero_quadratic(association):
    objective = PointsToCells(target=_voxels(6), points=_points(6), association=association)
    for x in (1e3, 1e9):
        far = objective.linearise(Pose(np.eye(3), np.array([x, 0.0, -x])))
        assert far.value == 0.0
        np.testing.assert_array_equal(far.hessian, np.zeros((6, 6)))


def test_an_unknown_association_is_rejected_with_the_names():
    with pytest.raises(InvalidInput, match=r"association must be one of own-cell, .*, got 'all'"):
        PointsToCells(target=_voxels(0), points=_points(0), association="all")


@pytest.mark.parametrize(
    ("width", "height", "sharpness"),
    [(1.0, 2.217, 0.433), (2.0, 4.196, 0.249), (3.0, 5.402, 0.193), (5.0, 6.931, 0.150)],
)
def test_magnussons_constants_for_an_outlier_ratio_of_0_55(width, height, sharpness):
    shape = ScoreShape.magnusson(width)
    np.testing.assert_allclose([shape.height, shape.sharpness], [height, sharpness], atol=6e-4)


@pytest.mark.parametrize(("width", "ratio"), [(1.0, 0.55), (3.0, 0.2), (0.5, 0.9)])
def test_magnussons_shape_is_the_log_likelihood_at_three_distances(width, ratio):
    shape = ScoreShape.magnusson(width, ratio)
    c1, c2 = 10.0 * (1.0 - ratio), ratio / width**3

    def cost(s):
        # Minus its limit far away, where the Gaussian is 0.
        return -np.log(c1 * np.exp(-0.5 * s) + c2) + np.log(c2)

    for s in (0.0, 1.0, 1e4):
        score = -shape.height * np.exp(-0.5 * shape.sharpness * s)
        np.testing.assert_allclose(score, cost(s), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("ratio", [0.0, 1.0, -0.5, float("nan")])
def test_outlier_ratios_out_of_range_are_rejected_by_name(ratio):
    with pytest.raises(InvalidInput, match="outlier_ratio must lie above 0 and below 1"):
        ScoreShape.magnusson(1.0, ratio)
