from dataclasses import replace

import numpy as np
import pytest

from reference import plane_constraints as reference
from scanlock.registration.verification.local_planes import LocalPlanes
from scanlock.registration.verification.plane_constraints import plane_constraints, regularised


def _planes(rng, count, flatness=1.0):
    normals = rng.normal(size=(count, 3))
    roots = rng.normal(0.0, 0.02, (count, 3, 3))
    return LocalPlanes(
        has_plane=np.ones(count, np.bool_),
        points=rng.uniform(-20.0, 20.0, (count, 3)),
        normals=normals / np.linalg.norm(normals, axis=1, keepdims=True),
        residuals=rng.normal(0.0, 0.05, count),
        normal_covariances=roots @ roots.transpose(0, 2, 1),
        flatness=np.full(count, flatness),
        thickness=np.full(count, 0.02),
    )


def test_information_and_gradient_are_sums_over_planes():
    planes, origin = _planes(np.random.default_rng(0), 40), np.array([3.0, -2.0, 1.0])
    constraints = plane_constraints(planes, origin)
    information, gradient, bias = reference.normal_equations(planes, origin)
    np.testing.assert_allclose(constraints.information, information, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(
        (constraints.weights * constraints.residuals) @ constraints.jacobian, gradient, atol=1e-10
    )
    np.testing.assert_allclose(
        constraints.bias_corrected_information(), information - bias, rtol=1e-7
    )


def test_planes_of_all_orientations_have_a_third_of_the_maximum_information():
    constraints = plane_constraints(_planes(np.random.default_rng(1), 20000), np.zeros(3))
    np.testing.assert_allclose(
        np.diag(constraints.information), np.diag(constraints.max_information) / 3.0, rtol=0.03
    )


def test_a_step_leads_onto_the_planes():
    planes = _planes(np.random.default_rng(2), 200)
    step = np.array([0.03, -0.02, 0.01, 0.0, 0.0, 0.0])
    shifted = replace(planes, residuals=planes.normals @ step[:3])
    # The weights of such small residuals are near one; damping shortens the step by a thirtieth.
    found = plane_constraints(shifted, np.zeros(3)).step()
    np.testing.assert_allclose(found, -step, atol=0.002)


def test_a_step_is_zero_along_unconstrained_directions():
    planes = _planes(np.random.default_rng(3), 50)
    floor = replace(planes, normals=np.tile([0.0, 0.0, 1.0], (50, 1)), residuals=np.full(50, 0.05))
    step = plane_constraints(floor, np.zeros(3)).step()
    assert step[2] == pytest.approx(-0.05, rel=0.05)
    np.testing.assert_allclose(step[[0, 1, 5]], 0.0, atol=1e-4)


def test_large_residuals_have_small_weights():
    planes = replace(_planes(np.random.default_rng(4), 20), residuals=np.repeat([0.0, 0.3], 10))
    constraints = plane_constraints(planes, np.zeros(3))
    np.testing.assert_allclose(constraints.weights, np.repeat([1.0, 0.1], 10))
    assert constraints.noise == pytest.approx(np.sqrt(10 * 0.1 * 0.3**2 / 11.0))


def test_there_are_no_constraints_with_too_few_flat_planes():
    rng = np.random.default_rng(5)
    assert plane_constraints(_planes(rng, 11), np.zeros(3)) is None
    assert plane_constraints(_planes(rng, 12), np.zeros(3)) is not None
    assert plane_constraints(_planes(rng, 120, flatness=0.5), np.zeros(3)) is None


def test_regularised_information_is_positive_definite():
    information = np.diag([4.0, 4.0, 0.0, 900.0, -1e-3, 0.0])
    found = regularised(information)
    assert (np.linalg.eigvalsh(found) > 0.0).all()
    np.testing.assert_allclose(found[0, 0], 4.0, rtol=1e-9)
    np.testing.assert_allclose(found[3, 3], 900.0, rtol=1e-9)


@pytest.mark.parametrize("difference", [0.0, 0.004, -0.01])
def test_a_difference_of_scale_is_estimated(difference):
    planes, origin = _planes(np.random.default_rng(4), 600), np.array([3.0, -2.0, 1.0])
    growth = np.einsum("ij,ij->i", planes.normals, planes.points - origin)
    noise = np.random.default_rng(5).normal(0.0, 0.005, 600)
    scaled = replace(planes, residuals=-difference * growth + noise)
    found, deviation = plane_constraints(scaled, origin).scale_difference()
    assert found == pytest.approx(difference, abs=0.15 * abs(difference) + 4.0 * deviation)
    assert 0.0 < deviation < 0.001


def test_a_motion_is_no_difference_of_scale():
    planes = _planes(np.random.default_rng(6), 300)
    step = np.array([0.02, -0.01, 0.015, 0.0005, -0.0004, 0.0003])
    motions = planes.normals @ step[:3] + np.cross(planes.points, planes.normals) @ step[3:]
    found, _ = plane_constraints(replace(planes, residuals=motions), np.zeros(3)).scale_difference()
    assert abs(found) < 1e-4


def test_no_plane_away_from_the_origin_tells_no_scale():
    planes = _planes(np.random.default_rng(7), 20)
    at_origin = replace(planes, points=np.zeros((20, 3)))
    found, _ = plane_constraints(at_origin, np.zeros(3)).scale_difference()
    assert np.isfinite(found)
