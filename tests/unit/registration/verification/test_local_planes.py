import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.local_planes import LocalPlaneFitter, concatenated


def _plane(count=4000, noise=0.0, seed=0):
    """Points of the plane z = 0.5 x within 4 m."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-4.0, 4.0, (2, count))
    return np.column_stack([x, y, 0.5 * x + noise * rng.normal(size=count)])


_NORMAL = np.array([-0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)
_ON_PLANE = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.5], [-1.0, 2.0, -0.5], [2.0, 0.0, 1.0]])

_NARROW = LocalPlaneFitter(radii=(0.5,))


def _fit(fitter, points, query_points):
    cloud = PointCloud.from_array(points)
    return fitter.fit(fitter.cell_list(cloud), query_points)


def test_residuals_are_signed_distances_from_the_plane():
    heights = np.array([-0.2, 0.0, 0.1, 0.3])
    planes = _fit(_NARROW, _plane(), _ON_PLANE + heights[:, None] * _NORMAL)
    assert planes.has_plane.all()
    signs = np.sign(planes.normals @ _NORMAL)
    np.testing.assert_allclose(signs * planes.residuals, heights, atol=1e-9)
    np.testing.assert_allclose(np.abs(planes.normals @ _NORMAL), 1.0, atol=1e-9)
    np.testing.assert_allclose(planes.flatness, 1.0, atol=1e-6)


def test_distant_and_sparse_neighbourhoods_have_no_plane():
    points = np.vstack([_plane(), [[20.0, 0.0, 0.0]] * 7])
    query_points = np.array([[0.0, 0.0, 5.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    planes = _fit(_NARROW, points, query_points)
    assert planes.has_plane.tolist() == [False, False, True]
    assert len(planes.residuals) == len(planes.normals) == len(planes.points) == 1


@pytest.mark.parametrize("length", [1.0, 0.0])
def test_lines_and_coincident_points_have_no_plane(length):
    line = np.array([0.0, 5.0, 1.0]) + np.outer(np.linspace(-2.0, 2.0, 400), np.eye(3)[0] * length)
    planes = _fit(_NARROW, line, np.array([[0.0, 5.0, 1.0]]))
    assert planes.has_plane.tolist() == [False]


def test_a_ball_of_points_is_not_flat():
    rng = np.random.default_rng(0)
    ball = np.array([4.0, 0.0, 0.0]) + rng.normal(0.0, 0.1, (500, 3))
    planes = _fit(_NARROW, ball, np.array([[4.0, 0.0, 0.0]]))
    assert planes.flatness[0] < 0.3


@pytest.mark.slow
def test_query_points_are_evenly_distributed_points_of_the_scan():
    near = np.random.default_rng(0).uniform((2.5, 2.5, -0.5), (3.5, 3.5, 0.5), (5000, 3))
    cloud = PointCloud.from_array(np.vstack([near, _plane(), np.zeros((100, 3))]))
    fitter = LocalPlaneFitter(sample_size=10**6)
    query_points = fitter.query_points(cloud)
    rows = {tuple(row) for row in cloud.points.tolist()}
    assert all(tuple(row) in rows for row in query_points.tolist())
    voxels = np.floor(query_points / fitter.voxel_size)
    assert len(np.unique(voxels, axis=0)) == len(query_points)
    assert not (query_points == 0.0).all(axis=1).any()
    assert len(LocalPlaneFitter(max_points=7).query_points(cloud)) == 7


def test_a_scan_without_measured_points_has_no_query_points():
    assert LocalPlaneFitter().query_points(PointCloud.from_array(np.zeros((5, 3)))).shape == (0, 3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("voxel_size", 0.0),
        ("radii", ()),
        ("radii", (0.5, -1.0)),
        ("max_points", 0),
        ("sample_size", 0),
        ("min_points", 2),
        ("min_eigenvalue_ratio", 1.5),
    ],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(InvalidInput, match=name):
        LocalPlaneFitter(**{name: value})


def test_normals_scatter_as_their_covariance_predicts():
    errors, covariances = [], []
    for seed in range(300):
        points = _plane(count=2500, noise=0.03, seed=seed)
        planes = _fit(_NARROW, points, np.array([[0.5, 0.5, 0.25]]))
        normal = planes.normals[0] * np.sign(planes.normals[0] @ _NORMAL)
        errors.append(normal - _NORMAL)
        covariances.append(planes.normal_covariances[0])
    scatter = np.mean([np.outer(error, error) for error in errors], axis=0)
    expected = np.mean(covariances, axis=0)
    y = np.array([0.0, 1.0, 0.0])
    assert y @ scatter @ y == pytest.approx(y @ expected @ y, rel=0.25)
    assert np.trace(scatter) == pytest.approx(np.trace(expected), rel=0.25)


def test_a_plane_is_fitted_within_the_first_radius_with_enough_points():
    rng = np.random.default_rng(0)
    dense, sparse = (rng.uniform(-side, side, (200, 2)) for side in (0.8, 8.0))
    points = np.vstack(
        [
            np.pad(dense, ((0, 0), (0, 1))),
            np.pad(sparse + np.array([20.0, 0.0]), ((0, 0), (0, 1)), constant_values=3.0),
        ]
    )
    query_points = np.array([[20.0, 0.0, 3.1], [0.0, 0.0, 0.2], [0.0, 9.0, 0.0]])
    both, narrow, wide = (
        _fit(LocalPlaneFitter(radii=radii), points, query_points)
        for radii in ((0.5, 2.0), (0.5,), (2.0,))
    )
    assert both.has_plane.tolist() == [True, True, False]
    # Ordered by radius.
    np.testing.assert_array_equal(both.points, query_points[[1, 0]])
    np.testing.assert_allclose(np.abs(both.residuals), [0.2, 0.1], atol=1e-9)
    assert narrow.has_plane.tolist() == [False, True, False]
    expected = np.concatenate([narrow.normal_covariances, wide.normal_covariances[:1]])
    np.testing.assert_allclose(both.normal_covariances, expected, atol=1e-15)


@pytest.mark.slow
def test_thickness_predicts_the_residual_of_one_more_point():
    residuals, predicted = [], []
    for seed in range(400):
        points = _plane(count=4000, noise=0.05, seed=seed)
        ordered = points[np.argsort(np.linalg.norm(points[:, :2], axis=1))]
        planes = _fit(_NARROW, ordered[1:], ordered[:1])
        residuals.append(planes.residuals[0])
        predicted.append(planes.thickness[0])
    assert np.std(residuals) == pytest.approx(np.sqrt(np.mean(np.square(predicted))), rel=0.15)
    assert np.mean(np.abs(residuals) > 2.0 * np.array(predicted)) == pytest.approx(0.06, abs=0.04)


def test_rmse_and_outlier_ratio_are_those_of_the_residuals():
    heights = np.array([0.0, 0.3, 0.01, -0.1])[:, None] * _NORMAL
    planes = _fit(_NARROW, _plane(), _ON_PLANE + heights)
    assert planes.rmse == pytest.approx(np.sqrt((0.09 + 0.0001 + 0.01) / 4.0))
    # The plane has no noise: two standard deviations of lidar noise are 4 cm.
    assert planes.outlier_ratio == 0.5
    empty = _fit(_NARROW, _plane(), _ON_PLANE + np.array([0.0, 0.0, 50.0]))
    assert np.isnan([empty.rmse, empty.outlier_ratio]).all()


def test_reversed_planes_constrain_the_same_motion():
    pose = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.1, 0.2, 0.9]))
    points, query_points, shift = _plane(), _ON_PLANE[:3], 0.07 * _NORMAL
    # The target is the plane; the source is the plane shifted, in its own frame.
    forward = _fit(_NARROW, points, query_points + shift)
    back = pose.inverse()
    backward = _fit(_NARROW, back.apply(points + shift), back.apply(query_points)).reversed(pose)
    np.testing.assert_allclose(backward.points, query_points, atol=1e-12)
    signs = np.sign(np.einsum("ij,ij->i", backward.normals, forward.normals))[:, None]
    np.testing.assert_allclose(backward.normals * signs, forward.normals, atol=1e-6)
    np.testing.assert_allclose(backward.residuals * signs[:, 0], forward.residuals, atol=1e-6)
    np.testing.assert_allclose(backward.normal_covariances, forward.normal_covariances, atol=1e-9)
    both = concatenated([forward, backward])
    assert both.has_plane.tolist() == [True] * 6
    np.testing.assert_array_equal(both.residuals[3:], backward.residuals)
