"""What a solver sees of an objective at one pose."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
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


@runtime_checkable
class Separable(Objective, Protocol):
    """An objective that is a sum over parts of the source, and can tell their shares."""

    @property
    def places(self) -> Points:
        """(m, 3) where the parts lie, in the source's frame [m]."""
        ...

    def shares(self, pose: Pose, units: Labels) -> "Contributions":
        """Return what each unit adds to gradient and Hessian at `pose`.

        Parameters
        ----------
        pose : Pose
            Target from source.
        units : (m,)
            The unit that each part belongs to, from 0 on, none of them empty.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Contributions:
    """What units of an objective add to its derivatives at a pose.

    Attributes
    ----------
    gradients : (u, 6)
    hessians : (u, 6, 6)
    """

    gradients: Matrix
    hessians: Matrix

    @classmethod
    def from_terms(cls, terms: Matrix) -> "Contributions":
        """Return the shares of a kernel's 28 sums, a row for each unit."""
        hessians = np.empty((len(terms), 6, 6))
        hessians[:, _UPPER[0], _UPPER[1]] = terms[:, 7:]
        hessians[:, _UPPER[1], _UPPER[0]] = terms[:, 7:]
        return cls(np.ascontiguousarray(terms[:, 1:7]), hessians)


def contributions_of_rows(
    units: Labels, arrays: Sequence[NDArray[Any]], terms: Callable[..., Vector]
) -> Contributions:
    """Return the shares of units whose rows of some (m, ...) arrays a kernel sums up.

    `terms` returns the 28 sums of the rows that it is given of each array.
    """
    order, runs = gathered(units)
    ordered = [read_only(array[order]) for array in arrays]
    found = [terms(*(array[run] for array in ordered)) for run in runs]
    return Contributions.from_terms(np.array(found))


def gathered(units: Labels) -> tuple[Labels, list[slice]]:
    """Return the rows with those of each unit together, and where each unit then lies."""
    order = np.argsort(units, kind="stable")
    ends = np.cumsum(np.bincount(units)).tolist()
    return read_only(order), [slice(a, b) for a, b in zip([0, *ends], ends, strict=False)]


def _symmetric(upper: Vector) -> Matrix:
    full = np.empty((6, 6))
    full[_UPPER] = upper
    full.T[_UPPER] = upper
    return full
