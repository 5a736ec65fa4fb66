"""Interface between solvers and objectives: value and derivatives at a pose."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Labels, Matrix, Points, Vector, read_only
from scanlock.geometry.pose import Pose

_UPPER = np.triu_indices(6)

Curvature = Literal["exact", "convex"]
"""Hessian of an objective: the exact one, or its convex part.

The convex part is the Gauss-Newton Hessian, which is never indefinite: the curvature of the score
and the second derivatives of the residuals are left out.
"""


@dataclass(frozen=True, slots=True, eq=False)
class Quadratic:
    """Value and derivatives of an objective for the step ``(rho, phi)`` at a pose.

    Attributes
    ----------
    value : float
        Value of the objective, which solvers minimise.
    gradient : (6,)
    hessian : (6, 6)
        Exact Hessian, which is indefinite away from a minimum, or its convex part.
    """

    value: float
    gradient: Vector
    hessian: Matrix

    @classmethod
    def from_terms(cls, terms: Vector) -> "Quadratic":
        """Return the quadratic of the 28 sums of a kernel: value, gradient, upper triangle."""
        return cls(float(terms[0]), terms[1:7], _symmetric(terms[7:]))

    @classmethod
    def empty(cls) -> "Quadratic":
        """Return the quadratic of an objective without terms: zero, with zero derivatives."""
        return cls(0.0, np.zeros(6), np.zeros((6, 6)))

    @property
    def is_empty(self) -> bool:
        """Whether the objective has no terms at the pose: value and derivatives are zero."""
        return self.value == 0.0 and not self.gradient.any() and not self.hessian.any()

    def after(self, step: Vector) -> "Quadratic":
        """Return the quadratic predicted at the pose after a small step."""
        change = self.hessian @ step
        value = self.value + float(step @ (self.gradient + 0.5 * change))
        return Quadratic(value, self.gradient + change, self.hessian)


class Objective(Protocol):
    """A function of the pose with value, gradient and Hessian."""

    @property
    def count(self) -> int:
        """Number of independent observations: points, Gaussians or correspondences."""
        ...

    def linearise(self, pose: Pose) -> Quadratic:
        """Return value, gradient and Hessian at `pose` (target from source).

        An objective without terms at the pose returns `Quadratic.empty()`.
        """
        ...


@runtime_checkable
class Separable(Objective, Protocol):
    """An objective that is a sum over elements of the source, with known contributions."""

    @property
    def positions(self) -> Points:
        """Positions of the m elements (m, 3), in the source's frame [m]."""
        ...

    @property
    def is_continuous(self) -> bool:
        """Whether the value is a continuous function of the pose."""
        ...

    def contributions(self, pose: Pose, blocks: Labels) -> "Contributions":
        """Return the contribution of each block of elements to gradient and Hessian at `pose`.

        Parameters
        ----------
        pose : Pose
            Target from source.
        blocks : (m,)
            Block of each element, from 0 on, without empty blocks.
        """
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Contributions:
    """Contributions of blocks of elements to the derivatives of an objective at a pose.

    Attributes
    ----------
    gradients : (b, 6)
    hessians : (b, 6, 6)
    """

    gradients: Matrix
    hessians: Matrix

    @classmethod
    def from_terms(cls, terms: Sequence[Vector] | Matrix) -> "Contributions":
        """Return the contributions of b blocks from the 28 sums of a kernel for each."""
        rows = np.array(terms).reshape(-1, 28)
        hessians = np.empty((len(rows), 6, 6))
        hessians[:, _UPPER[0], _UPPER[1]] = rows[:, 7:]
        hessians[:, _UPPER[1], _UPPER[0]] = rows[:, 7:]
        return cls(np.ascontiguousarray(rows[:, 1:7]), hessians)


def contributions_of_rows(
    blocks: Labels, arrays: Sequence[NDArray[Any]], terms: Callable[..., Vector]
) -> Contributions:
    """Return the contributions of blocks of rows of some (m, ...) arrays.

    Parameters
    ----------
    blocks : (m,)
        Block of each row.
    arrays : sequence of (m, ...)
        Arguments of `terms`, row by row.
    terms : callable
        Returns the 28 sums over the rows that it gets of each array.
    """
    order, runs = rows_by_block(blocks)
    ordered = [read_only(array[order]) for array in arrays]
    found = [terms(*(array[run] for array in ordered)) for run in runs]
    return Contributions.from_terms(found)


def rows_by_block(blocks: Labels) -> tuple[Labels, list[slice]]:
    """Return the rows sorted by block, and the slice of each block in that order."""
    order = np.argsort(blocks, kind="stable")
    ends = np.cumsum(np.bincount(blocks)).tolist()
    return read_only(order), [slice(a, b) for a, b in zip([0, *ends], ends, strict=False)]


def scale_vector(rotation_scale: float) -> Vector:
    """Return the (6,) factors from a step ``(rho, phi)`` [m, rad] to scaled units [m]."""
    return np.array([1.0, 1.0, 1.0, rotation_scale, rotation_scale, rotation_scale])


def _symmetric(upper: Vector) -> Matrix:
    full = np.empty((6, 6))
    full[_UPPER] = upper
    full.T[_UPPER] = upper
    return full
