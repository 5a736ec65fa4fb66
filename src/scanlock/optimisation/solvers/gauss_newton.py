"""A single Gauss-Newton step, for methods that build a new objective after every step."""

import numpy as np

from scanlock.arrays import Vector
from scanlock.optimisation.solvers.problem import Quadratic, scale_vector

_MIN_CURVATURE = 1e-9
"""Minimum curvature of a constrained direction, over the largest one; less is rounding."""


def gauss_newton_step(quadratic: Quadratic, rotation_scale: float) -> Vector:
    """Return the step ``(rho, phi)`` [m, rad] to the minimum of a convex quadratic.

    Directions without curvature, among them locked ones, do not move.

    Parameters
    ----------
    quadratic : Quadratic
        Quadratic with the convex part of the Hessian.
    rotation_scale : float [m]
        Distance at which a rotation counts as a translation when curvatures are compared.

    Returns
    -------
    (6,)
        Translation [m] first, then rotation [rad].
    """
    scale = scale_vector(rotation_scale)
    curvatures, axes = np.linalg.eigh(quadratic.hessian / np.outer(scale, scale))
    is_constrained = curvatures > _MIN_CURVATURE * curvatures[-1]
    along = axes.T @ (quadratic.gradient / scale)
    coefficients = np.divide(-along, curvatures, out=np.zeros(6), where=is_constrained)
    return (axes @ coefficients) / scale
