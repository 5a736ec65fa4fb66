import numpy as np
import pytest

from reference import differences
from reference.samples import rotated_covariances
from scanlock.arrays import read_only
from scanlock.geometry.pose import Pose
from scanlock.geometry.rigid_fit import fit_arun
from scanlock.models.gaussians import unpacked
from scanlock.optimisation.objectives.point_pairs import (
    PointPairs,
    noise_precisions,
    plane_precisions,
    point_precisions,
    variances_along,
)
from scanlock.optimisation.solvers.criteria import ConvergenceCriteria
from scanlock.optimisation.solvers.newton import Newton

STEPS = np.array([1e-4] * 3 + [1e-5] * 3)
POSE = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.4, 0.9]))


def _packed(full):
    return np.ascontiguousarray(full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]])


def _normals(rng, count):
    normals = rng.normal(size=(count, 3))
    return normals / np.linalg.norm(normals, axis=1)[:, None]


def _scene(kind, count=40):
    """Points, rows of the correspondences, and packed precisions of a kind."""
    rng = np.random.default_rng(7)
    source = rng.normal(0.0, 10.0, (count + 5, 3))
    target = rng.permutation(POSE.apply(source) + rng.normal(0.0, 1.0, source.shape))
    rows = rng.integers(0, len(source), (2, count))
    weights = rng.uniform(0.1, 2.0, count)
    if kind == "point":
        precisions = point_precisions(weights)
    elif kind == "plane":
        precisions = plane_precisions(_normals(rng, count), weights)
    else:
        sides = [rotated_covariances(rng, rng.uniform(0.1, 1.0, (count, 3))) for _ in range(2)]
        precisions = noise_precisions(*map(_packed, sides), POSE)
    return target, source, *rows, precisions


def _pairs(kind, curvature="exact"):
    target, source, target_rows, source_rows, precisions = _scene(kind)
    return PointPairs(
        target=read_only(target),
        source=read_only(source),
        target_rows=read_only(target_rows),
        source_rows=read_only(source_rows),
        precisions=precisions,
        curvature=curvature,
    )


_kinds = pytest.mark.parametrize("kind", ["point", "plane", "noise"])


@_kinds
def test_values_match_the_definition(kind):
    target, source, target_rows, source_rows, precisions = _scene(kind)
    residuals = POSE.apply(source)[source_rows] - target[target_rows]
    expected = 0.5 * np.einsum("mi,mij,mj->m", residuals, unpacked(precisions), residuals).mean()
    np.testing.assert_allclose(_pairs(kind).linearise(POSE).value, expected, rtol=1e-12)


@_kinds
def test_gradient_and_hessian_match_differences(kind):
    pairs = _pairs(kind)
    quadratic = pairs.linearise(POSE)
    gradient = differences.gradient(lambda pose: pairs.linearise(pose).value, POSE, STEPS)
    np.testing.assert_allclose(quadratic.gradient, gradient, rtol=1e-7, atol=1e-8)
    hessian = differences.hessian(lambda pose: pairs.linearise(pose).gradient, POSE, STEPS)
    scale = np.abs(hessian).max()
    np.testing.assert_allclose(quadratic.hessian, hessian, rtol=1e-6, atol=1e-8 * scale)


@_kinds
def test_the_convex_hessian_is_the_gauss_newton_hessian(kind):
    _, source, _, source_rows, precisions = _scene(kind)
    moved = POSE.apply(source)[source_rows]
    zero = np.zeros(len(moved))
    x, y, z = moved.T
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    jacobian = np.concatenate([np.broadcast_to(np.eye(3), skew.shape), -skew], axis=2)
    expected = np.einsum("mia,mij,mjb->ab", jacobian, unpacked(precisions), jacobian) / len(moved)
    convex = _pairs(kind, "convex").linearise(POSE)
    np.testing.assert_allclose(convex.hessian, expected, rtol=1e-10, atol=1e-10)
    np.testing.assert_array_equal(convex.gradient, _pairs(kind).linearise(POSE).gradient)


def test_point_to_plane_residuals_do_not_depend_on_the_sign_of_the_normal():
    rng = np.random.default_rng(1)
    normals, residuals, weights = (
        _normals(rng, 20),
        rng.normal(size=(20, 3)),
        rng.uniform(0.1, 1, 20),
    )
    for signed in (normals, -normals):
        full = unpacked(plane_precisions(signed, weights))
        found = np.einsum("mi,mij,mj->m", residuals, full, residuals)
        np.testing.assert_allclose(found, weights * (normals * residuals).sum(axis=1) ** 2)


def test_noise_precisions_are_inverses_of_summed_covariances():
    rng = np.random.default_rng(2)
    first, second = (rotated_covariances(rng, rng.uniform(0.1, 1, (9, 3))) for _ in range(2))
    found = unpacked(noise_precisions(_packed(first), _packed(second), POSE))
    turned = POSE.rotation @ second @ POSE.rotation.T
    np.testing.assert_allclose(found, np.linalg.inv(first + turned), rtol=1e-10, atol=1e-10)
    normals = _normals(rng, 9)
    along = np.einsum("mi,mij,mj->m", normals, first, normals)
    np.testing.assert_allclose(variances_along(normals, _packed(first)), along, rtol=1e-12)


def test_the_point_to_point_minimum_is_the_closed_form():
    pairs = _pairs("point")
    rows = pairs.target_rows, pairs.source_rows
    weights = pairs.precisions[:, 0]
    solution = Newton(
        criteria=ConvergenceCriteria(gradient_tolerance=1e-10, step_tolerance=1e-10)
    ).minimise(pairs, POSE)
    fitted = fit_arun(pairs.target[rows[0]], pairs.source[rows[1]], weights)
    assert pairs.count == len(weights)
    assert solution.pose.is_close(fitted, translation=1e-6, rotation=1e-7)
