"""Covariance of an estimated pose, by three methods.

The gradients of all blocks of the scene cancel at the estimated pose. With other samples of the
same scene they would cancel at another pose. The sandwich estimator of Huber and White predicts by
how much, from the scatter of the gradients g of independent blocks: ``H^-1 (sum g g') H^-1``.
Neighbouring correspondences are not independent: they lie on one surface, with one systematic
error. A block is therefore a cube of some metres. Each gradient is divided by the Hessian of the
other blocks, one Newton step of the jackknife that leaves out one of U blocks at a time::

    d_u = (H - H_u)^-1 g_u        C = (U - 1) / U sum (d_u - mean d) (d_u - mean d)'

Errors common to all blocks do not scatter. A pose that follows the sampling pattern of the scans is
one of them, see `sampling_pattern`. The others are those of viewpoint and calibration. Their size
was measured: one factor for each method. Where the pattern is unknown, the standard deviations of
roll and pitch are inflated, on which the heights of the rings ahead and behind act most.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import get_args

import numpy as np

from scanlock.arrays import Labels, Matrix, Points, Vector
from scanlock.errors import InvalidInput, require_at_least, require_count, require_positive
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import (
    UNCONSTRAINED,
    ConstrainedObjective,
    Constraints,
)
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.problem import Objective, Separable
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod
from scanlock.registration.uncertainty.sampling_pattern import SamplingPattern
from scanlock.registration.uncertainty.sandwich import (
    inflated,
    sandwich_covariance,
    whitening_matrix,
)
from scanlock.registration.uncertainty.scene_cells import SceneCells, scene_cells

_SINGULAR = "the Hessian is singular: some direction is unconstrained"

_ROLL_PITCH = (3, 4)
"""Components of roll and pitch in a step ``(rho, phi)``."""

_MIN_ROTATION_SCALE = 1.0
"""Minimum rotation scale [m], the distance at which a rotation counts as a translation."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CovarianceEstimator:
    """Settings of the estimator of a pose covariance."""

    method: CovarianceMethod = "sandwich"
    """``"sandwich"``: from the scatter of the gradients of independent blocks. ``"hessian"``: from
    the curvature at the minimum, with all points independent, which is overconfident.
    ``"sampled"``: the sandwich plus the scatter of poses refined from perturbed starts."""

    block_size: float = 8.0
    """Side of a block [m]; the points of one block count as one observation."""

    min_block_size: float = 0.5
    """Minimum side of a block [m]. With fewer than `min_blocks` blocks, their side is halved down
    to this."""

    min_blocks: int = 20
    """Minimum number of blocks; with fewer there is no covariance."""

    min_deviation: float = 3e-4
    """Minimum standard deviation of the position of the scene [m], and of a rotation about its
    centroid, at the distance of its points. Scans that agree to the last digit are not exact."""

    roll_pitch_inflation: float = 1.75
    """Inflation of the standard deviations of roll and pitch, and of the errors correlated with
    them, where the sampling pattern is unknown: in map coordinates and for sparse clouds. With 1.75
    they contribute a third of the NEES, averaged over methods. Use 1 if z does not point
    upwards."""

    start_deviations: tuple[float, float] = (0.3, 0.05)
    """Standard deviations of the perturbed starts of ``"sampled"`` [m, rad]: those of the initial
    pose."""

    def __post_init__(self) -> None:
        if self.method not in get_args(CovarianceMethod):
            methods = ", ".join(get_args(CovarianceMethod))
            raise InvalidInput(f"covariance must be one of {methods}, or None, got {self.method!r}")
        for name in ("block_size", "min_block_size", "min_deviation"):
            require_positive(name, getattr(self, name), unit="m")
        require_count("min_blocks", self.min_blocks, 8)
        require_at_least("roll_pitch_inflation", self.roll_pitch_inflation, 1.0)
        for one, unit in zip(self.start_deviations, ("m", "rad"), strict=True):
            require_positive("start_deviations", one, unit=unit)

    def estimate(
        self,
        solution: Solution,
        factor: float,
        align: Callable[[Pose], Solution],
        pattern: SamplingPattern | None = None,
    ) -> tuple[Matrix, float] | str:
        """Estimate the covariance of the pose of a solution, or say why there is none.

        Parameters
        ----------
        solution : Solution
            Solution with its objective.
        factor : float
            Factor of the standard deviations, as measured for the method of registration.
        align : callable
            Returns the solution from another initial pose, for the method "sampled".
        pattern : SamplingPattern, optional
            Sampling pattern of the target; None if it is unknown. Roll and pitch are inflated then.

        Returns
        -------
        matrix : (6, 6)
            Covariance between the local frames, in the order of `PosePrior`: the translation of
            the source's origin, then the rotation about the target's axes.
        blocks : float
            Effective number of blocks; NaN for the method "hessian".
        """
        objective, constraints = _split(solution.objective)
        if objective is None or solution.reason is StopReason.EMPTY_OBJECTIVE:
            return "no correspondences at the pose"
        if not isinstance(objective, Separable):
            return "the objective is not separable into blocks"
        pose, free = solution.pose, np.flatnonzero(constraints.free_directions)
        points = objective.positions
        estimated = self._covariance_of_step(objective, constraints, pose, factor, pattern)
        if isinstance(estimated, str):
            return estimated
        covariance, blocks = estimated
        full, block = np.zeros((6, 6)), np.ix_(free, free)
        full[block] = covariance + self._min_covariance(points, pose)[block]
        # From a step of `Pose.retract` to one of `Pose.perturbed`, about the source's origin.
        adjoint = Pose(np.eye(3), -pose.translation).adjoint()
        matrix = adjoint @ full @ adjoint.T
        if self.method == "sampled":
            sampled = self._sampled_covariance(pose, free, align)
            if sampled is None:
                return "no correspondences from any perturbed start"
            matrix += sampled
        return matrix, blocks

    def _covariance_of_step(
        self,
        objective: Separable,
        constraints: Constraints,
        pose: Pose,
        factor: float,
        pattern: SamplingPattern | None,
    ) -> tuple[Matrix, float] | str:
        """Return the covariance of a step along the free directions, and the number of blocks."""
        free = np.flatnonzero(constraints.free_directions)
        prior = np.zeros((len(free), len(free)))
        if constraints.prior is not None:
            # As in `ConstrainedObjective`: the objective is a mean over observations, the prior
            # is one more.
            hessian = constraints.prior.linearise(pose).hessian
            prior = hessian[np.ix_(free, free)] / objective.count
        rotation_scale = _rotation_scale(objective.positions)
        scales = np.array([1.0, 1.0, 1.0, rotation_scale, rotation_scale, rotation_scale])[free]
        if self.method == "hessian":
            hessian = _hessian_over_variance(objective, pose, free)
            whitening = whitening_matrix(hessian + prior, scales)
            if whitening is None:
                return _SINGULAR
            return whitening @ whitening.T / objective.count, math.nan
        cells = scene_cells(objective, pose, self.block_size, self.min_block_size, self.min_blocks)
        if cells is None:
            return f"fewer than {self.min_blocks} blocks of the scene have correspondences"
        terms = cells.block_terms(free)
        whitening = whitening_matrix(terms.hessians.sum(axis=0) + prior, scales)
        if whitening is None:
            return _SINGULAR
        whitened, blocks = sandwich_covariance(terms, whitening)
        inverse = whitening @ whitening.T
        covariance = factor**2 * (whitening @ whitened @ whitening.T)
        if pattern is None:
            rows = np.flatnonzero(np.isin(free, _ROLL_PITCH))
            covariance = inflated(covariance, rows, self.roll_pitch_inflation)
        else:
            response = inverse @ _pattern_hessian(objective, cells)[np.ix_(free, free)]
            displacement = pattern.covariance(pose)[np.ix_(free, free)]
            covariance = covariance + response @ displacement @ response.T
        # The gradient of the prior has the covariance of its own Hessian.
        return covariance + inverse @ prior @ inverse / objective.count, blocks

    def _min_covariance(self, points: Points, pose: Pose) -> Matrix:
        """Return the (6, 6) minimum covariance of a step."""
        centroid = points.mean(axis=0)
        rotation = self.min_deviation / _rotation_scale(points - centroid)
        variances = [self.min_deviation**2] * 3 + [rotation**2] * 3
        adjoint = Pose(np.eye(3), pose.apply(centroid)).adjoint()
        return adjoint @ np.diag(variances) @ adjoint.T

    def _sampled_covariance(
        self, pose: Pose, free: Labels, align: Callable[[Pose], Solution]
    ) -> Matrix | None:
        """Return the mean square error of the poses refined from perturbed starts.

        The starts are the points of the unscented transform without the central one: two along
        each free direction, with the covariance of `start_deviations`. None if no start has
        correspondences.
        """
        distances = math.sqrt(len(free)) * np.repeat(self.start_deviations, 3)
        errors: list[Vector] = []
        for sign in (1.0, -1.0):
            for axis in free:
                step = np.zeros(6)
                step[axis] = sign * distances[axis]
                refined = align(pose.perturbed(step))
                if refined.reason is not StopReason.EMPTY_OBJECTIVE:
                    errors.append(refined.pose.difference(pose))
        if not errors:
            return None
        return np.einsum("na,nb->ab", errors, errors) / len(errors)


def _rotation_scale(offsets: Points) -> float:
    """Return the root mean squared length of (n, 3) offsets [m], or the minimum."""
    return max(math.sqrt(3.0 * float(np.mean(np.square(offsets)))), _MIN_ROTATION_SCALE)


def _pattern_hessian(objective: Separable, cells: SceneCells) -> Matrix:
    """Return the (6, 6) Hessian of an objective against a displacement of the sampling pattern.

    An objective that jumps where a point changes its cell follows the pattern whole: its
    derivatives say nothing of the jumps.
    """
    if objective.is_continuous:
        return cells.hessian_along_surfaces()
    return cells.hessians.sum(axis=0)


def _hessian_over_variance(objective: Objective, pose: Pose, free: Labels) -> Matrix:
    """Return the Hessian along the free directions, divided by the variance of the residuals.

    Sums of squares are positive and contain that variance. Scores are negative and have no such
    scale; their Hessian is returned as it is.
    """
    quadratic = objective.linearise(pose)
    hessian = quadratic.hessian[np.ix_(free, free)]
    if quadratic.value <= 0.0:
        return hessian
    degrees_of_freedom = max(objective.count - len(free), 1)
    return hessian * (degrees_of_freedom / (2.0 * quadratic.value * objective.count))


def chosen_estimator(
    covariance: bool | CovarianceMethod | CovarianceEstimator | None,
) -> CovarianceEstimator | None:
    """Return the settings of a covariance by their short forms; None without one.

    Parameters
    ----------
    covariance : bool or str or CovarianceEstimator
        True for the default settings, False or None for none, or the name of a method.

    Raises
    ------
    InvalidInput
        Anything else.
    """
    match covariance:
        case CovarianceEstimator():
            return covariance
        case True:
            return CovarianceEstimator()
        case False | None:
            return None
        case str():
            return CovarianceEstimator(method=covariance)
        case _:
            raise InvalidInput(
                "covariance must be True, False, the name of a method or a CovarianceEstimator, "
                f"got {covariance!r}"
            )


def _split(objective: Objective | None) -> tuple[Objective | None, Constraints]:
    """Return an objective without its constraints, and the constraints."""
    if isinstance(objective, ConstrainedObjective):
        return objective.objective, objective.constraints
    return objective, UNCONSTRAINED
