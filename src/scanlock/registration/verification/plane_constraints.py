"""The planes that two scans share, as a pose stands on them: what they hold, and where they pull.

A plane holds a translation along its normal, and a rotation that moves its place along its normal;
summed over the planes that the probes of either scan meet in the other, that is an information
matrix of the pose.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.geometry.rotations import hats
from scanlock.registration.verification.local_planes import LocalPlanes

_LEAST_FLATNESS = 0.9
"""Of a surface that counts as a plane: across, its deviation is a third of that along it."""

_ROUGHNESS = 0.1
"""Gaps of this [m] halve the weight of a plane: it is not the same surface."""

_LEAST_PLANES = 12
"""Fewer planes say nothing: twice the six numbers of a pose."""

_DAMPING = 0.01
"""Share of the planes that resist any step: along what nothing holds there is none to take."""

_LEAST_NOISE = 0.01
"""Deviation of a gap [m] that is assumed at least, however well a few planes fit."""


@dataclass(frozen=True, slots=True, eq=False)
class PlaneConstraints:
    """Planes about the source's origin, in the target's frame.

    Attributes
    ----------
    origin : (3,) [m]
        The source's, in the target's frame.
    places : (k, 3) [m]
        From the source's origin.
    gaps : (k,) [m]
        Of the places from their planes.
    weights : (k,)
        Of the planes, in [0, 1]: less where the gap is wide.
    doubts : (k, 3, 3)
        Covariances of the normals.
    rows : (k, 6)
        How each gap changes with a step ``(rho, phi)``.
    information : (6, 6)
        Of such a step, in planes: one plane whose normal is along a direction adds one.
    possible : (6, 6)
        What it would be if every plane faced every motion of its place.
    """

    origin: Vector
    points: Points
    residuals: Vector
    weights: Vector
    normal_covariances: NDArray[np.float64]
    rows: Matrix
    information: Matrix
    max_information: Matrix

    def __post_init__(self) -> None:
        for array in (
            self.origin, self.points, self.residuals, self.weights, self.normal_covariances,
            self.rows, self.information, self.max_information,
        ):  # fmt: skip
            frozen(array)

    @property
    def noise(self) -> float:
        """Deviation of the gaps [m]."""
        return max(
            _LEAST_NOISE, math.sqrt(float(self.weights @ self.residuals**2 / self.weights.sum()))
        )

    def step(self) -> Vector:
        """Return the (6,) step of Gauss and Newton onto the planes, slightly damped [m, rad]."""
        damped = supported(self.information + _DAMPING * self.max_information)
        step = -np.linalg.solve(damped, (self.weights * self.residuals) @ self.rows)
        return step.astype(np.float64, copy=False)

    def bias_corrected_information(self) -> Matrix:
        """Return the information less what of it comes from noise of the normals alone.

        A normal that is off sees motions along its plane, in an endless corridor those along it
        too.
        """
        k = len(self.points)
        # How a normal that is off by (3,) feels a motion.
        motions = np.empty((k, 3, 6))
        motions[:, :, :3] = np.eye(3)
        motions[:, :, 3:] = -hats(self.points)
        doubted = (self.weights[:, None, None] * self.normal_covariances) @ motions
        doubtful = motions.reshape(3 * k, 6).T @ doubted.reshape(3 * k, 6)
        return supported(self.information - doubtful)


def plane_constraints(surface: LocalPlanes, origin: Vector) -> PlaneConstraints | None:
    """Return the planes of a surface about the source's origin (3,) [m] in the target's frame.

    None where too few planes are met to tell.
    """
    flat = surface.flatness > _LEAST_FLATNESS
    if np.count_nonzero(flat) < _LEAST_PLANES:
        return None
    normals, residuals, points = (
        surface.normals[flat],
        surface.residuals[flat],
        surface.points[flat] - origin,
    )
    weights = 1.0 / (1.0 + (residuals / _ROUGHNESS) ** 2)
    rows = np.hstack([normals, _crossed(points, normals)])
    max_information = np.zeros((6, 6))
    max_information[:3, :3] = weights.sum() * np.eye(3)
    squares = (weights[:, None] * points).T @ points
    max_information[3:, 3:] = np.trace(squares) * np.eye(3) - squares
    return PlaneConstraints(
        origin,
        points,
        residuals,
        weights,
        surface.normal_covariances[flat],
        rows,
        (weights[:, None] * rows).T @ rows,
        max_information,
    )


def supported(information: Matrix) -> Matrix:
    """Return (6, 6) information, at least a millionth of what is held in its own unit, everywhere.

    What no plane holds at all must not end the arithmetic, nor what noise leaves below nothing.
    """
    units = np.sqrt(
        np.repeat([np.trace(information[:3, :3]), np.trace(information[3:, 3:])], 3) / 3.0
    )
    units = np.maximum(units, 1e-9)
    held, axes = np.linalg.eigh(information / np.outer(units, units))
    return (axes * np.maximum(held, 1e-6)) @ axes.T * np.outer(units, units)


def _crossed(first: Points, second: Points) -> Points:
    """Return (k, 3) cross products: NumPy's own takes five times as long."""
    a, b, c = first.T
    x, y, z = second.T
    return np.column_stack([b * z - c * y, c * x - a * z, a * y - b * x])
