"""Point-to-plane refinement of a pose, and the distance by which it moves the pose.

Gauss-Newton steps on planes fitted anew after each step. A correct but coarse pose is refined by
some centimetres and then fits; a wrong pose keeps large residuals.
"""

import math
from dataclasses import dataclass

from scanlock.arrays import Vector
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.local_planes import LocalPlanes, concatenated
from scanlock.registration.verification.observability import Observability, observability_of
from scanlock.registration.verification.plane_constraints import plane_constraints

_MAX_STEPS = 4
"""Maximum number of steps. Three mostly suffice; where four do not, the pose is wrong or
degenerate."""

_MIN_STEP = 0.02
"""Length of a step [m] below which the planes are not fitted again: they would be the same."""

_ROTATION_SCALE = 0.3 / math.radians(1.0)
"""Distance at which a rotation counts as a translation: 17 m, where the tolerances of a correct
pose, 0.3 m and 1 degree, are equal."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Refinement:
    """Planes at a pose and at the refined pose, with the observability there.

    Attributes
    ----------
    target_planes : LocalPlanes
        Planes of the target around the source's query points, at the pose before refinement.
    source_planes : LocalPlanes
        Planes of the source around the target's query points, at the pose before refinement.
    refined_planes : LocalPlanes
        Planes of both scans at the refined pose.
    observability : Observability or None
        Observability of the refined pose; None if the scans share too few planes.
    refinement_shift : float [m]
        Distance by which refinement moves the source, at 17 m from its origin; NaN if the scans
        share too few planes.
    scale_difference : tuple of float
        Relative difference of scale at the refined pose, and its standard deviation; NaN if the
        scans share too few planes.
    """

    target_planes: LocalPlanes
    source_planes: LocalPlanes
    refined_planes: LocalPlanes
    observability: Observability | None
    refinement_shift: float
    scale_difference: tuple[float, float] = (math.nan, math.nan)


def refine_pose(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose
) -> Refinement:
    """Refine a pose, target from source in the local frames of the scans, point-to-plane."""
    target_planes, source_planes = _fit_planes(target, source, pose)
    planes = concatenated([target_planes, source_planes])
    constraints = plane_constraints(planes, pose.translation)
    is_sparse = target.cloud.takes_sparse_settings and source.cloud.takes_sparse_settings
    refined = pose
    for _ in range(_MAX_STEPS):
        if constraints is None:
            return Refinement(
                target_planes=target_planes,
                source_planes=source_planes,
                refined_planes=planes,
                observability=None,
                refinement_shift=math.nan,
            )
        step = constraints.step()
        refined = refined.perturbed(step)
        if _length(step) < _MIN_STEP:
            break
        planes = concatenated(_fit_planes(target, source, refined))
        constraints = plane_constraints(planes, refined.translation)
    return Refinement(
        target_planes=target_planes,
        source_planes=source_planes,
        refined_planes=planes,
        observability=(
            None
            if constraints is None
            else observability_of(constraints, target.cluster_constraints, is_sparse)
        ),
        refinement_shift=_length(refined.difference(pose)),
        scale_difference=(
            (math.nan, math.nan) if constraints is None else constraints.scale_difference()
        ),
    )


def _fit_planes(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose
) -> tuple[LocalPlanes, LocalPlanes]:
    """Return the planes of the target, then those of the source, in the target's frame."""
    of_target = target.planes_around(pose.apply(source.query_points))
    of_source = source.planes_around(pose.inverse().apply(target.query_points))
    return of_target, of_source.reversed(pose)


def _length(step: Vector) -> float:
    """Return the length [m] of a step ``(rho, phi)``."""
    return math.hypot(*step[:3], *(_ROTATION_SCALE * step[3:]))
