"""How sure a registration is: the covariance of its pose, in three ways.

A pose is where the gradients of all parts of the source balance. Were the parts other ones, from
another sampling of the same scene, they would balance elsewhere; how far, the scatter of the
gradients tells (the sandwich of Huber and White): ``H^-1 (sum g g') H^-1`` over independent pieces
of evidence. Parts side by side are not independent: they see one surface, with one misfit. So a
unit is all that lies in one cube of some metres; and its gradient is divided by what is left of
the Hessian without it, which makes the sandwich one Newton step of the jackknife that leaves out
one unit after the other::

    d_u = (H - H_u)^-1 g_u        C = (U - 1) / U sum (d_u - mean d) (d_u - mean d)'

What all units share no scatter shows: a sensor sees everything from one side, and its rings draw
the same pattern on all ground. How much that is was measured, one factor for each method, and one
that all share for tilts: what the rings add to heights has another sign ahead than behind.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.clouds.voxel_grid import voxel_indices, voxel_labels
from scanlock.errors import InvalidInput, require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hat, log_rotation
from scanlock.optimisation.objectives.constraints import (
    UNCONSTRAINED,
    ConstrainedObjective,
    Constraints,
)
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective, Separable
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod
from scanlock.registration.uncertainty.sandwich import BlockTerms, root_of, sandwich, tilted

_OPEN = "the minimum is open along some direction"

_TILTS = (3, 4)
"""Where the rotations about x and y are in a step."""

_LEAST_ARM = 1.0
"""Least distance at which a rotation of all parts counts as a translation [m]."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CovarianceEstimator:
    """Settings that find the covariance of a pose."""

    method: CovarianceMethod = "sandwich"
    """``"sandwich"``, by the scatter among independent parts of the scene; ``"hessian"``, by the
    curvature at the minimum alone, as if each part were independent: overconfident, as it is
    elsewhere; ``"sampled"``, the sandwich plus the spread of where starts around the pose end."""

    block_size: float = 8.0
    """Parts in one cube of this side are one unit [m]."""

    min_block_size: float = 0.5
    """Where the parts fill fewer cubes than `least_units`, cubes are halved, down to this [m]."""

    min_blocks: int = 20
    """Of fewer cubes no covariance is told."""

    min_deviation: float = 3e-4
    """Least deviation of the parts as a whole [m], and of a rotation about their middle at their
    mean distance: scans that agree to the last digit are not exact."""

    tilt_inflation: float = 1.75
    """Rotations about the target's x and y, and what hangs on them, are this many times as far off
    as the scatter tells, beyond the factor of the method: they then have a third of the squared
    error in the mean over the methods. Where z does not point upwards, give 1."""

    start_deviations: tuple[float, float] = (0.3, 0.05)
    """The sampled way: deviations of the starts [m, rad]; those of what is known before."""

    def __post_init__(self) -> None:
        if self.method not in get_args(CovarianceMethod):
            ways = ", ".join(get_args(CovarianceMethod))
            raise InvalidInput(f"covariance must be one of {ways}, or None, got {self.method!r}")
        for name in ("block_size", "min_block_size", "min_deviation"):
            require_positive(name, getattr(self, name), unit="m")
        require_count("min_blocks", self.min_blocks, 8)
        require_at_least("tilt_inflation", self.tilt_inflation, 1.0)
        for one, unit in zip(self.start_deviations, ("m", "rad"), strict=True):
            require_positive("start_deviations", one, unit=unit)

    def estimate(
        self, solution: Solution, factor: float, align: Callable[[Pose], Solution]
    ) -> tuple[Matrix, float] | str:
        """Return the covariance of a solution's pose, or why there is none.

        Parameters
        ----------
        solution : Solution
            With the objective that it ended at.
        factor : float
            Deviations are this many times those that the scatter within the scans tells.
        align : callable
            Returns the solution from another start, for the sampled way.

        Returns
        -------
        matrix : (6, 6)
            Between the local frames, in the order of `PosePrior`: of where zero of the source
            lands, then of the rotation about the target's axes.
        units : float
            Effective number of units; NaN by the Hessian alone.
        """
        objective, constraints = _opened(solution.objective)
        if objective is None or solution.reason is StopReason.EMPTY_OBJECTIVE:
            return "nothing of the scans met"
        if not isinstance(objective, Separable):
            return "the objective does not tell the shares of its parts"
        pose, free = solution.pose, np.flatnonzero(constraints.free_directions)
        places = objective.places
        found = self._within(objective, places, constraints, pose, factor)
        if isinstance(found, str):
            return found
        inner, units = found
        full = np.zeros((6, 6))
        full[np.ix_(free, free)] = inner + self._floored(places, pose)[np.ix_(free, free)]
        # From a step about zero of the target to the place of the source's zero.
        to_place = np.eye(6)
        to_place[:3, 3:] = -hat(pose.translation)
        matrix = to_place @ full @ to_place.T
        if self.method == "sampled":
            spread = self._spread(pose, free, align)
            if spread is None:
                return "no start around the pose led anywhere"
            matrix += spread
        return matrix, units

    def _within(
        self,
        objective: Separable,
        places: Points,
        constraints: Constraints,
        pose: Pose,
        factor: float,
    ) -> tuple[Matrix, float] | str:
        """Return the covariance of a step along the free directions, by what is at one pose."""
        free = np.flatnonzero(constraints.free_directions)
        prior = np.zeros((len(free), len(free)))
        if constraints.prior is not None:
            # As in the objective under restraint: a mean over the parts, and a prior beside them.
            whole = constraints.prior.linearise(pose).hessian
            prior = whole[np.ix_(free, free)] / objective.count
        arm = max(math.sqrt(3.0 * float(np.mean(np.square(places)))), _LEAST_ARM)
        scale = np.array([1.0, 1.0, 1.0, arm, arm, arm])[free]
        if self.method == "hessian":
            root = root_of(_whitened(objective, pose, free) + prior, scale)
            return _OPEN if root is None else (root @ root.T / objective.count, math.nan)
        shares = self._shares(objective, places, pose, free)
        if shares is None:
            return f"fewer than {self.min_blocks} separate places of the scene met"
        root = root_of(shares.hessians.sum(axis=0) + prior, scale)
        if root is None:
            return _OPEN
        scatter, units = sandwich(shares, root)
        tilts = np.flatnonzero(np.isin(free, _TILTS))
        scattered = tilted(root @ scatter @ root.T, tilts, self.tilt_inflation)
        inverse = root @ root.T
        # A prior's gradient scatters by its own Hessian.
        return factor**2 * scattered + inverse @ prior @ inverse / objective.count, units

    def _shares(
        self, objective: Separable, places: Points, pose: Pose, free: Labels
    ) -> BlockTerms | None:
        """Return what cubes of half a block add, and two ways to join eight of them to a unit.

        The ways lie half a block apart along all axes: the covariance then hangs less on where
        the cubes happen to cut the scene.
        """
        side = self.block_size
        while side >= self.min_block_size:
            labels, cells = voxel_indices(places, 0.5 * side)
            shares = objective.shares(pose, labels)
            met = np.flatnonzero(shares.hessians.any(axis=(1, 2)))
            if len(met):
                corners = cells[met].astype(np.float64)
                grids = tuple(voxel_labels(corners + shift, 2.0)[0] for shift in (0.5, 1.5))
                if min(int(grid.max()) + 1 for grid in grids) >= self.min_blocks:
                    gradients = shares.gradients[np.ix_(met, free)]
                    return BlockTerms(gradients, shares.hessians[np.ix_(met, free, free)], grids)
            side *= 0.5
        return None

    def _floored(self, places: Points, pose: Pose) -> Matrix:
        """Return the floor as the covariance of a step."""
        middle = places.mean(axis=0)
        arm = math.sqrt(3.0 * float(np.mean(np.square(places - middle))))
        to_zero = np.eye(6)
        to_zero[:3, 3:] = hat(pose.apply(middle))
        turn = self.min_deviation / max(arm, _LEAST_ARM)
        return to_zero @ np.diag([self.min_deviation**2] * 3 + [turn**2] * 3) @ to_zero.T

    def _spread(self, pose: Pose, free: Labels, align: Callable[[Pose], Solution]) -> Matrix | None:
        """Return the mean square of how far from the pose starts on either side of it end.

        The starts lie along each free direction, so far out that their covariance is the one
        asked for (the points of the unscented transform, without the middle one).
        """
        reach = math.sqrt(len(free)) * np.repeat(self.start_deviations, 3)
        errors: list[Vector] = []
        for axis in (*free, *free + 6):
            step = np.zeros(6)
            step[axis % 6] = reach[axis % 6] if axis < 6 else -reach[axis % 6]
            start = Pose(exp_rotation(step[3:]) @ pose.rotation, pose.translation + step[:3])
            end = align(start)
            if end.reason is not StopReason.EMPTY_OBJECTIVE:
                turn = log_rotation(end.pose.rotation @ pose.rotation.T)
                errors.append(np.concatenate([end.pose.translation - pose.translation, turn]))
        if not errors:
            return None
        return np.einsum("na,nb->ab", errors, errors) / len(errors)


def _whitened(objective: Objective, pose: Pose, free: Labels) -> Matrix:
    """Return the Hessian along the free directions over the variance of the residuals.

    A mean of squares is positive and says what that is. A score is not, and has no such scale.
    """
    at = objective.linearise(pose)
    hessian = at.hessian[np.ix_(free, free)]
    if at.value <= 0.0:
        return hessian
    return hessian * (max(objective.count - len(free), 1) / (2.0 * at.value * objective.count))


def _opened(objective: Objective | None) -> tuple[Objective | None, Constraints]:
    """Return what the scans say and what else holds the pose."""
    if isinstance(objective, ConstrainedObjective):
        return objective.objective, objective.constraints
    return objective, UNCONSTRAINED
