from dataclasses import replace

import numpy as np
import pytest

from reference import footing as reference
from scanlock.registration.verification.local_planes import LocalPlanes
from scanlock.registration.verification.plane_constraints import plane_constraints, supported


def _surface(rng, count, flatness=1.0):
    normals = rng.normal(size=(count, 3))
    roots = rng.normal(0.0, 0.02, (count, 3, 3))
    return LocalPlanes(
        np.ones(count, np.bool_),
        rng.uniform(-20.0, 20.0, (count, 3)),
        normals / np.linalg.norm(normals, axis=1, keepdims=True),
        rng.normal(0.0, 0.05, count),
        roots @ roots.transpose(0, 2, 1),
        np.full(count, flatness),
        np.full(count, 0.02),
    )


def test_it_is_that_of_the_planes_one_by_one():
    surface, origin = _surface(np.random.default_rng(0), 40), np.array([3.0, -2.0, 1.0])
    footing = plane_constraints(surface, origin)
    information, gradient, doubtful = reference.summed(surface, origin)
    np.testing.assert_allclose(footing.information, information, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(
        (footing.weights * footing.residuals) @ footing.rows, gradient, atol=1e-10
    )
    np.testing.assert_allclose(
        footing.bias_corrected_information(), information - doubtful, rtol=1e-7
    )


def test_planes_that_face_everywhere_hold_a_third_of_what_is_possible():
    footing = plane_constraints(_surface(np.random.default_rng(1), 20000), np.zeros(3))
    np.testing.assert_allclose(
        np.diag(footing.information), np.diag(footing.max_information) / 3.0, rtol=0.03
    )


def test_a_step_leads_onto_the_planes():
    surface = _surface(np.random.default_rng(2), 200)
    step = np.array([0.03, -0.02, 0.01, 0.0, 0.0, 0.0])
    off = replace(surface, residuals=surface.normals @ step[:3])
    # The weights of gaps this small are near one, and the damping takes a thirtieth.
    np.testing.assert_allclose(plane_constraints(off, np.zeros(3)).step(), -step, atol=0.002)


def test_along_what_nothing_holds_there_is_no_step():
    surface = _surface(np.random.default_rng(3), 50)
    floor = replace(surface, normals=np.tile([0.0, 0.0, 1.0], (50, 1)), residuals=np.full(50, 0.05))
    step = plane_constraints(floor, np.zeros(3)).step()
    assert step[2] == pytest.approx(-0.05, rel=0.05)
    np.testing.assert_allclose(step[[0, 1, 5]], 0.0, atol=1e-4)


def test_gaps_of_another_surface_count_less():
    residuals = np.repeat([0.0, 0.3], 10)
    footing = plane_constraints(
        replace(_surface(np.random.default_rng(4), 20), residuals=residuals), np.zeros(3)
    )
    np.testing.assert_allclose(footing.weights, np.repeat([1.0, 0.1], 10))
    assert footing.noise == pytest.approx(np.sqrt(10 * 0.1 * 0.3**2 / 11.0))


def test_too_few_planes_say_nothing():
    rng = np.random.default_rng(5)
    assert plane_constraints(_surface(rng, 11), np.zeros(3)) is None
    assert plane_constraints(_surface(rng, 12), np.zeros(3)) is not None
    assert plane_constraints(_surface(rng, 120, flatness=0.5), np.zeros(3)) is None


def test_information_of_nothing_is_raised_until_it_can_be_inverted():
    information = np.diag([4.0, 4.0, 0.0, 900.0, -1e-3, 0.0])
    raised = supported(information)
    assert (np.linalg.eigvalsh(raised) > 0.0).all()
    np.testing.assert_allclose(raised[0, 0], 4.0, rtol=1e-9)
    np.testing.assert_allclose(raised[3, 3], 900.0, rtol=1e-9)
