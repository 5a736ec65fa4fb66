"""Derivatives along `Pose.retract` by central differences of the fourth order."""

import numpy as np


def along(function, pose, direction):
    """Return ``d/dh function(pose.retract(h direction))`` at h = 0, with unit h."""

    def at(h):
        return np.asarray(function(pose.retract(h * direction)))

    return (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / 12.0


def gradient(value, pose, steps):
    """Gradient of a value by differences, with one small step for each of the six coordinates."""
    return np.array([along(value, pose, row) for row in np.diag(steps)]) / steps


def hessian(gradient_at, pose, steps):
    """Hessian in the step ``(rho, phi)`` by differences of a gradient.

    A gradient at a retracted pose is that of a second step after the first. A rotation followed
    by a translation is the step ``(rho, phi)`` itself; a translation followed by a rotation is
    not. A rotation about two axes is, to second order, the mean of both orders.
    """
    rows = np.array([along(gradient_at, pose, row) for row in np.diag(steps)]) / steps[:, None]
    full = np.empty((6, 6))
    full[:3, :3] = 0.5 * (rows[:3, :3] + rows[:3, :3].T)
    full[3:, :3] = rows[3:, :3]
    full[:3, 3:] = rows[3:, :3].T
    full[3:, 3:] = 0.5 * (rows[3:, 3:] + rows[3:, 3:].T)
    return full
