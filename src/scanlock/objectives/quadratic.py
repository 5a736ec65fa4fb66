"""What a solver sees of an objective at one pose."""

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from scanlock.arrays import Matrix, Vector
from scanlock.geometry.pose import Pose

_UPPER = np.triu_indices(6)

Curvature = Literal["exact", "convex"]
"""The Hessian of an objective: the exact one, or its part that is never indefinite.

The convex part is that of Gauss and Newton: the curvature of the score, and the second
derivatives of the residuals, are left out.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """Value and derivatives of an objective for the step ``(rho, phi)`` at a pose.

    Attributes
    ----------
    value : float
        The objective itself; always minimised.
    gradient : (6,)
    hessian : (6, 6)
        Exact, and then indefinite away from a minimum; or its convex part.
    """

    value: float
    gradient: Vector
    hessian: Matrix

    @classmethod
    def from_terms(cls, terms: Vector) -> "Quadratic":
        """Return the quadratic of a kernel's 28 sums: 1, 6 and 21 numbers."""
        return cls(float(terms[0]), terms[1:7], _symmetric(terms[7:]))

    def after(self, step: Vector) -> "Quadratic":
        """Return what this one foretells for the pose a small step on."""
        change = self.hessian @ step
        value = self.value + float(step @ (self.gradient + 0.5 * change))
        return Quadratic(value, self.gradient + change, self.hessian)


class Objective(Protocol):
    """Anything that can be linearised at a pose."""

    @property
    def count(self) -> int:
        """Independent observations that the value is a mean over: points, Gaussians or pairs."""
        ...

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose` (target from source)."""
        ...


def _symmetric(upper: Vector) -> Matrix:
    full = np.empty((6, 6))
    full[_UPPER] = upper
    full.T[_UPPER] = upper
    return full
