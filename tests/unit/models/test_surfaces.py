import numpy as np
import pytest

from reference import surfaces as reference
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.models.gaussians import unpacked
from scanlock.models.surfaces import Neighbourhoods, surface_covariances, surface_normals


def _cloud(seed, count=300):
    return np.random.default_rng(seed).uniform(-5.0, 5.0, (count, 3))


def _wall(seed, normal, distance, count=400, noise=0.01):
    rng = np.random.default_rng(seed)
    normal = np.array(normal) / np.linalg.norm(normal)
    first, second = np.linalg.svd(normal[None])[2][1:]
    along = rng.uniform(-4.0, 4.0, (count, 2))
    across = distance + rng.normal(0.0, noise, (count, 1))
    return along[:, :1] * first + along[:, 1:] * second + across * normal


@pytest.mark.parametrize("neighbours", [4, 10, 20])
@pytest.mark.parametrize("shape", ["plane", "ellipsoid"])
def test_covariances_match_their_definition(shape, neighbours):
    points = _cloud(neighbours)
    expected = {
        "plane": reference.plane_covariances,
        "ellipsoid": reference.ellipsoid_covariances,
    }[shape](points, neighbours, 1e-3)
    found = surface_covariances(points, neighbours, shape=shape)
    np.testing.assert_allclose(unpacked(found), expected, atol=1e-10)


def test_the_default_shape_is_that_of_the_paper():
    variances = np.linalg.eigvalsh(unpacked(surface_covariances(_cloud(1))))
    np.testing.assert_allclose(variances, np.tile([1e-3, 1.0, 1.0], (300, 1)), atol=1e-12)


def test_the_epsilon_is_the_variance_along_the_normal():
    points = _wall(0, [0.0, 0.0, 1.0], 3.0, noise=0.0)
    np.testing.assert_allclose(
        surface_covariances(points, covariance_epsilon=0.02),
        np.tile([1.0, 0.0, 0.0, 1.0, 0.0, 0.02], (len(points), 1)),
        atol=1e-12,
    )


@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 0), (1, -2, 0.5)])
@pytest.mark.parametrize("distance", [6.0, -6.0])
def test_normals_of_a_wall_face_the_origin(normal, distance):
    points = _wall(1, normal, distance)
    normals = surface_normals(points)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, rtol=1e-12)
    towards = -np.sign(distance) * np.array(normal) / np.linalg.norm(normal)
    # Ten points over a metre and a centimetre of noise: a few degrees.
    assert np.median(normals @ towards) > 0.9999
    assert (normals @ towards > 0.98).all()


def test_a_normal_is_the_axis_of_least_variance():
    points = _cloud(2)
    full = unpacked(surface_covariances(points, 12))
    normals = surface_normals(points, 12)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", full, normals), 1e-3 * normals, atol=1e-10)


def test_an_ellipsoid_of_a_wire_is_not_a_plane():
    wire = np.column_stack([np.linspace(0.0, 10.0, 50), np.zeros((50, 2))])
    np.testing.assert_allclose(
        surface_covariances(wire, shape="ellipsoid"),
        np.tile([1.0, 0.0, 0.0, 1e-3, 0.0, 1e-3], (50, 1)),
        atol=1e-12,
    )


def test_points_far_from_the_origin_have_the_same_surface():
    points = _wall(3, [1.0, 2.0, 3.0], 2.0)
    far = surface_covariances(points + np.array([5e5, -4e6, 300.0]))
    np.testing.assert_allclose(far, surface_covariances(points), atol=1e-4)


@pytest.mark.parametrize("count", [1, 2, 3, 9])
def test_fewer_points_than_neighbours_are_all_neighbours(count):
    points = _cloud(4, count)
    found = surface_covariances(points, 10)
    assert found.shape == (count, 6)
    np.testing.assert_allclose(np.linalg.eigvalsh(unpacked(found))[:, 0], 1e-3, atol=1e-12)
    if count == 9:
        expected = reference.plane_covariances(points, 9, 1e-3)
        np.testing.assert_allclose(unpacked(found), expected, atol=1e-10)


@pytest.mark.parametrize("shape", ["plane", "ellipsoid"])
def test_equal_points_have_a_finite_covariance(shape):
    found = surface_covariances(np.full((30, 3), 2.5), shape=shape)
    variances = np.linalg.eigvalsh(unpacked(found))
    assert (variances > 0.9e-3).all()
    assert (variances < 1.1).all()
    assert np.isfinite(surface_normals(np.full((30, 3), 2.5))).all()


def test_a_tree_gives_the_surfaces_in_its_own_order():
    points = _cloud(6)
    tree = PointTree.from_points(points)
    covariances, normals = surface_covariances(tree, 12), surface_normals(tree, 12)
    np.testing.assert_array_equal(covariances, surface_covariances(points, 12)[tree.rows])
    np.testing.assert_array_equal(normals, surface_normals(points, 12)[tree.rows])


def test_radii_are_the_deviations_of_the_neighbours():
    points = _cloud(7)
    nearest = [np.argsort(np.linalg.norm(points - one, axis=1))[:10] for one in points]
    expected = [np.sqrt(points[rows].var(axis=0).sum()) for rows in nearest]
    np.testing.assert_allclose(Neighbourhoods.around(points).radii, expected, rtol=1e-9)


def test_points_are_not_changed():
    points = _cloud(5)
    before = points.copy()
    surface_covariances(points)
    surface_normals(points)
    np.testing.assert_array_equal(points, before)
    assert points.flags.writeable


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"neighbours": 3}, "neighbours must be a whole number of at least 4, got 3"),
        ({"shape": "sphere"}, "shape must be 'plane' or 'ellipsoid', got 'sphere'"),
        ({"covariance_epsilon": 0.0}, "covariance_epsilon must be positive"),
        ({"covariance_epsilon": 2.0}, "covariance_epsilon must lie between 0 and 1"),
    ],
)
def test_invalid_settings_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        surface_covariances(_cloud(0), **settings)
