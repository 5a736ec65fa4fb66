import numpy as np
import pytest

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.local_planes import LocalPlaneFitter, joined


def _plane(count=4000, noise=0.0, seed=0):
    """Points of the plane z = 0.5 x within 4 m."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(-4.0, 4.0, (2, count))
    return np.column_stack([x, y, 0.5 * x + noise * rng.normal(size=count)])


_NARROW = LocalPlaneFitter(radii=(0.5,))


def _probe(prober, cloud, query_points):
    return prober.fit(prober.cell_list(cloud), query_points)


_NORMAL = np.array([-0.5, 0.0, 1.0]) / np.hypot(0.5, 1.0)


def test_gaps_are_the_distances_from_the_plane():
    cloud = PointCloud.from_array(_plane())
    heights = np.array([-0.2, 0.0, 0.1, 0.3])
    query_points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.5], [-1.0, 2.0, -0.5], [2.0, 0.0, 1.0]])
    surface = _probe(_NARROW, cloud, query_points + heights[:, None] * _NORMAL)
    assert surface.has_plane.all()
    signs = np.sign(surface.normals @ _NORMAL)
    np.testing.assert_allclose(signs * surface.residuals, heights, atol=1e-9)
    np.testing.assert_allclose(np.abs(surface.normals @ _NORMAL), 1.0, atol=1e-9)
    np.testing.assert_allclose(surface.flatness, 1.0, atol=1e-6)


def test_what_is_too_far_or_too_thin_is_not_met():
    cloud = PointCloud.from_array(np.vstack([_plane(), [[20.0, 0.0, 0.0]] * 7]))
    far = np.array([[0.0, 0.0, 5.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    surface = _probe(_NARROW, cloud, far)
    assert surface.has_plane.tolist() == [False, False, True]
    assert len(surface.residuals) == len(surface.normals) == len(surface.points) == 1


@pytest.mark.parametrize("along", [1.0, 0.0])
def test_lines_and_single_places_are_no_planes(along):
    line = np.array([0.0, 5.0, 1.0]) + np.outer(np.linspace(-2.0, 2.0, 400), np.eye(3)[0] * along)
    surface = _probe(_NARROW, PointCloud.from_array(line), np.array([[0.0, 5.0, 1.0]]))
    assert surface.has_plane.tolist() == [False]


def test_a_ball_of_points_is_not_flat():
    rng = np.random.default_rng(0)
    ball = np.array([4.0, 0.0, 0.0]) + rng.normal(0.0, 0.1, (500, 3))
    surface = _probe(_NARROW, PointCloud.from_array(ball), np.array([[4.0, 0.0, 0.0]]))
    assert surface.flatness[0] < 0.3


def test_probes_are_points_of_the_scan_spread_evenly_and_not_too_many():
    near = np.random.default_rng(0).uniform((2.5, 2.5, -0.5), (3.5, 3.5, 0.5), (5000, 3))
    cloud = PointCloud.from_array(np.vstack([near, _plane(), np.zeros((100, 3))]))
    prober = LocalPlaneFitter(sample_size=10**6)
    query_points = prober.query_points(cloud)
    rows = {tuple(row) for row in cloud.points.tolist()}
    assert all(tuple(row) in rows for row in query_points.tolist())
    cubes = np.floor(query_points / prober.voxel_size)
    assert len(np.unique(cubes, axis=0)) == len(query_points)
    assert not (query_points == 0.0).all(axis=1).any()
    assert len(LocalPlaneFitter(max_points=7).query_points(cloud)) == 7


def test_a_scan_of_nothing_has_no_probes():
    assert LocalPlaneFitter().query_points(PointCloud.from_array(np.zeros((5, 3)))).shape == (0, 3)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("spacing", 0.0),
        ("radii", ()),
        ("radii", (0.5, -1.0)),
        ("most", 0),
        ("sample", 0),
        ("least_count", 2),
        ("least_breadth", 1.5),
    ],
)
def test_settings_out_of_range_are_refused(name, value):
    with pytest.raises(InvalidInput, match=name):
        LocalPlaneFitter(**{name: value})


def test_the_doubt_of_a_normal_is_how_far_it_is_off():
    # Planes fitted to fresh noise, many times over: their normals scatter as they say.
    prober, tips, normal_covariances = _NARROW, [], []
    for seed in range(300):
        cloud = PointCloud.from_array(_plane(count=2500, noise=0.03, seed=seed))
        surface = _probe(prober, cloud, np.array([[0.5, 0.5, 0.25]]))
        off = surface.normals[0] * np.sign(surface.normals[0] @ _NORMAL) - _NORMAL
        tips.append(off)
        normal_covariances.append(surface.normal_covariances[0])
    scatter = np.mean([np.outer(off, off) for off in tips], axis=0)
    expected = np.mean(normal_covariances, axis=0)
    along = np.array([0.0, 1.0, 0.0])
    assert along @ scatter @ along == pytest.approx(along @ expected @ along, rel=0.25)
    assert np.trace(scatter) == pytest.approx(np.trace(expected), rel=0.25)


def test_each_probe_is_looked_at_in_the_first_circle_that_holds_enough():
    rng = np.random.default_rng(0)
    dense, sparse = (rng.uniform(-side, side, (200, 2)) for side in (0.8, 8.0))
    points = np.vstack(
        [
            np.pad(dense, ((0, 0), (0, 1))),
            np.pad(sparse + np.array([20.0, 0.0]), ((0, 0), (0, 1)), constant_values=3.0),
        ]
    )
    cloud = PointCloud.from_array(points)
    query_points = np.array([[20.0, 0.0, 3.1], [0.0, 0.0, 0.2], [0.0, 9.0, 0.0]])
    surface, narrow, wide = (
        _probe(LocalPlaneFitter(radii=radii), cloud, query_points)
        for radii in ((0.5, 2.0), (0.5,), (2.0,))
    )
    assert surface.has_plane.tolist() == [True, True, False]
    # In the order in which they are met.
    np.testing.assert_array_equal(surface.points, query_points[[1, 0]])
    np.testing.assert_allclose(np.abs(surface.residuals), [0.2, 0.1], atol=1e-9)
    assert narrow.has_plane.tolist() == [False, True, False]
    expected = np.concatenate([narrow.normal_covariances, wide.normal_covariances[:1]])
    np.testing.assert_allclose(surface.normal_covariances, expected, atol=1e-15)


def test_a_gap_scatters_as_thickness_says():
    # One more point of a noisy plane: the gap it has, over many planes.
    residuals, told = [], []
    for seed in range(400):
        points = _plane(count=4000, noise=0.05, seed=seed)
        near = points[np.argsort(np.linalg.norm(points[:, :2], axis=1))]
        surface = _probe(_NARROW, PointCloud.from_array(near[1:]), near[:1])
        residuals.append(surface.residuals[0])
        told.append(surface.thickness[0])
    assert np.std(residuals) == pytest.approx(np.sqrt(np.mean(np.square(told))), rel=0.15)
    assert np.mean(np.abs(residuals) > 2.0 * np.array(told)) == pytest.approx(0.06, abs=0.04)


def test_roughness_and_misfit_are_of_the_gaps():
    cloud = PointCloud.from_array(_plane())
    query_points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.5], [-1.0, 2.0, -0.5], [2.0, 0.0, 1.0]])
    off = np.array([0.0, 0.3, 0.01, -0.1])[:, None] * _NORMAL
    surface = _probe(_NARROW, cloud, query_points + off)
    assert surface.roughness == pytest.approx(np.sqrt((0.09 + 0.0001 + 0.01) / 4.0))
    # The points scatter by nothing: twice the noise of a lidar is 4 cm.
    assert surface.outlier_ratio == 0.5
    nothing = _probe(_NARROW, cloud, query_points + np.array([0.0, 0.0, 50.0]))
    assert np.isnan([nothing.roughness, nothing.outlier_ratio]).all()


def test_seen_back_a_surface_tells_of_the_same_motion():
    # The plane moves under probes that stay, or the probes move over a plane that stays.
    pose = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.1, 0.2, 0.9]))
    plane = _plane()
    query_points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.5], [-1.0, 2.0, -0.5]])
    shift = 0.07 * _NORMAL
    # Target: plane; source: probes lifted by the shift and carried away by the pose's inverse.
    forward = _probe(_NARROW, PointCloud.from_array(plane), query_points + shift)
    source = PointCloud.from_array(pose.inverse().apply(plane + shift))
    backward = _probe(_NARROW, source, pose.inverse().apply(query_points)).reversed(pose)
    np.testing.assert_allclose(backward.points, query_points, atol=1e-12)
    signs = np.sign(np.einsum("ij,ij->i", backward.normals, forward.normals))[:, None]
    np.testing.assert_allclose(backward.normals * signs, forward.normals, atol=1e-6)
    np.testing.assert_allclose(backward.residuals * signs[:, 0], forward.residuals, atol=1e-6)
    np.testing.assert_allclose(backward.normal_covariances, forward.normal_covariances, atol=1e-9)
    both = joined([forward, backward])
    assert both.has_plane.tolist() == [True] * 6
    np.testing.assert_array_equal(both.residuals[3:], backward.residuals)
