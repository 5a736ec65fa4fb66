"""One step of Gauss and Newton, for those who make a new objective after every step."""

import numpy as np

from scanlock.arrays import Vector
from scanlock.optimisation.solvers.problem import Quadratic

_LEAST_CURVATURE = 1e-9
"""Directions with less than this share of the largest curvature are held by rounding alone."""


def gauss_newton_step(quadratic: Quadratic, rotation_scale: float) -> Vector:
    """Return the step ``(rho, phi)`` [m, rad] to the minimum of a convex quadratic.

    Directions that the quadratic leaves open, or that a restraint locks, do not move.

    Parameters
    ----------
    quadratic : Quadratic
        With the convex part of its Hessian.
    lever : float [m]
        Distance at which a rotation counts as a translation, to tell what is open.
    """
    scale = np.array([1.0, 1.0, 1.0, rotation_scale, rotation_scale, rotation_scale])
    curvatures, axes = np.linalg.eigh(quadratic.hessian / np.outer(scale, scale))
    is_held = curvatures > _LEAST_CURVATURE * curvatures[-1]
    along = axes.T @ (quadratic.gradient / scale)
    coefficients = np.divide(-along, curvatures, out=np.zeros(6), where=is_held)
    return (axes @ coefficients) / scale
