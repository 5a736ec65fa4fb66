"""Point-to-plane constraints between two scans at a pose: information, gradient, step.

A plane constrains translations along its normal, and rotations that move its point along its
normal. The sum over all planes is the normal matrix of a Gauss-Newton step, the information on the
pose.
"""

import math
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen, short_repr
from scanlock.geometry.rotations import hats
from scanlock.registration.verification.local_planes import LocalPlanes

_MIN_FLATNESS = 0.9
"""Minimum flatness of a plane: its thickness is at most a third of its extent."""

_RESIDUAL_SCALE = 0.1
"""Scale of the Cauchy weight [m]: a residual of this size, likely of another surface, has weight
one half."""

_MIN_PLANES = 12
"""Minimum number of planes: twice the six parameters of a pose."""

_DAMPING = 0.01
"""Damping of a step as a fraction of the maximum information; it suppresses steps along degenerate
directions."""

_SCALE_DAMPING = 1e-6
"""Damping of the step with a scale, relative to the information on each parameter."""

_MIN_INFORMATION = 1e-12
"""Minimum information on a parameter, to avoid a division by zero."""

_MIN_NOISE = 0.01
"""Minimum standard deviation of the residuals [m], however well a few planes fit."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class PlaneConstraints:
    """Linearised point-to-plane constraints, in axes of the target about the source's origin.

    Attributes
    ----------
    origin : (3,) [m]
        Origin of the source, in the target's frame.
    points : (k, 3) [m]
        Query points, relative to the origin of the source.
    residuals : (k,) [m]
        Signed distances of the points from their planes.
    weights : (k,)
        Cauchy weights of the residuals, in [0, 1].
    normal_covariances : (k, 3, 3)
        Covariances of the normals.
    jacobian : (k, 6)
        Derivatives of the residuals with respect to a step ``(rho, phi)``.
    information : (6, 6)
        Weighted normal matrix of a step, in units of one plane: a plane of weight one adds one
        along its normal.
    max_information : (6, 6)
        Information if every plane were perpendicular to every motion of its point.
    """

    origin: Vector
    points: Points
    residuals: Vector
    weights: Vector
    normal_covariances: NDArray[np.float64]
    jacobian: Matrix
    information: Matrix
    max_information: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for one in fields(self):
            frozen(getattr(self, one.name))

    @property
    def noise(self) -> float:
        """Weighted standard deviation of the residuals [m]."""
        return max(
            _MIN_NOISE, math.sqrt(float(self.weights @ self.residuals**2 / self.weights.sum()))
        )

    def step(self) -> Vector:
        """Return the (6,) damped Gauss-Newton step ``(rho, phi)`` [m, rad]."""
        damped = regularised(self.information + _DAMPING * self.max_information)
        step = -np.linalg.solve(damped, (self.weights * self.residuals) @ self.jacobian)
        return step.astype(np.float64, copy=False)

    def scale_difference(self) -> tuple[float, float]:
        """Estimate the relative difference of scale of the scans, and its standard deviation.

        The seventh parameter of a Gauss-Newton step: the source is scaled about its origin by
        ``1 + difference``. Scans of one scale have 0.0005 or less.
        """
        growth = np.einsum("ij,ij->i", self.jacobian[:, :3], self.points)
        jacobian = np.column_stack([self.jacobian, growth])
        weighted = self.weights[:, None] * jacobian
        information = weighted.T @ jacobian
        units = np.sqrt(np.maximum(np.diag(information), _MIN_INFORMATION))
        normalised = information / np.outer(units, units) + _SCALE_DAMPING * np.eye(7)
        last = np.linalg.solve(normalised, np.eye(7)[6])
        difference = -float(last @ (self.residuals @ weighted / units)) / float(units[6])
        return difference, self.noise * math.sqrt(float(last[6])) / float(units[6])

    def bias_corrected_information(self) -> Matrix:
        """Return the (6, 6) information without its bias from noisy normals.

        A noisy normal constrains motions along its plane too, such as those along an endless
        corridor.
        """
        return regularised(self.information - self.bias())

    def bias(self) -> Matrix:
        """Return the (6, 6) mean information of the noise of the normals alone."""
        k = len(self.points)
        # Derivative of the motion of each point with respect to a step.
        motions = np.empty((k, 3, 6))
        motions[:, :, :3] = np.eye(3)
        motions[:, :, 3:] = -hats(self.points)
        weighted = (self.weights[:, None, None] * self.normal_covariances) @ motions
        return motions.reshape(3 * k, 6).T @ weighted.reshape(3 * k, 6)


def plane_constraints(planes: LocalPlanes, origin: Vector) -> PlaneConstraints | None:
    """Linearise the point-to-plane constraints about the origin (3,) of the source [m].

    Planes and origin are in the target's frame. None if there are too few flat planes.
    """
    flat = planes.flatness > _MIN_FLATNESS
    if np.count_nonzero(flat) < _MIN_PLANES:
        return None
    normals, residuals = planes.normals[flat], planes.residuals[flat]
    points = planes.points[flat] - origin
    weights = 1.0 / (1.0 + (residuals / _RESIDUAL_SCALE) ** 2)
    jacobian = np.hstack([normals, _cross(points, normals)])
    max_information = np.zeros((6, 6))
    max_information[:3, :3] = weights.sum() * np.eye(3)
    squares = (weights[:, None] * points).T @ points
    max_information[3:, 3:] = np.trace(squares) * np.eye(3) - squares
    return PlaneConstraints(
        origin=origin,
        points=points,
        residuals=residuals,
        weights=weights,
        normal_covariances=planes.normal_covariances[flat],
        jacobian=jacobian,
        information=(weights[:, None] * jacobian).T @ jacobian,
        max_information=max_information,
    )


def regularised(information: Matrix) -> Matrix:
    """Return a (6, 6) information matrix with a minimum eigenvalue, so that it can be inverted.

    The minimum is a millionth of the mean information on translation and on rotation. Without
    planes along a direction the eigenvalue is zero; the correction of the bias can make it
    negative.
    """
    scales = np.sqrt(
        np.repeat([np.trace(information[:3, :3]), np.trace(information[3:, 3:])], 3) / 3.0
    )
    scales = np.maximum(scales, 1e-9)
    eigenvalues, axes = np.linalg.eigh(information / np.outer(scales, scales))
    return (axes * np.maximum(eigenvalues, 1e-6)) @ axes.T * np.outer(scales, scales)


def _cross(first: Points, second: Points) -> Points:
    """Return the (k, 3) cross products, five times as fast as `numpy.cross`."""
    a, b, c = first.T
    x, y, z = second.T
    return np.column_stack([b * z - c * y, c * x - a * z, a * y - b * x])
