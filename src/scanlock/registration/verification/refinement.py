"""Where a pose comes to rest on the surfaces that both scans show, and how far off it was.

Gauss and Newton's steps onto planes that are fitted anew after each: a pose that is off by some
centimetres comes to rest where it should have been, and what is left of the misfit there tells
right places from wrong ones.
"""

import math
from dataclasses import dataclass

from scanlock.arrays import Vector
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, log_rotation
from scanlock.registration.verification.features import PROBER, VerificationFeatures
from scanlock.registration.verification.local_planes import LocalPlanes, joined
from scanlock.registration.verification.observability import Observability, observability_of
from scanlock.registration.verification.plane_constraints import plane_constraints

_MOST_STEPS = 4
"""Three mostly do; where four do not, the pose is wrong, or held by nothing."""

_SMALL_STEP = 0.02
"""After a step shorter than this [m] the planes are the same: no probing anew is worth it."""

_ROTATION_SCALE = 0.3 / math.radians(1.0)
"""Where a rotation counts as a distance [m]: a pose may be off by 0.3 m or by a degree to count as
right, which is 17 m away the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Refinement:
    """A pose and what it came to.

    Attributes
    ----------
    ahead : ProbedSurface
        What the source's probes meet of the target, at the pose itself.
    back : ProbedSurface
        What the target's probes meet of the source there.
    surface : ProbedSurface
        What either meets of the other where the pose came to rest.
    hold : Hold or None
        How firmly that holds it; None where they share too few planes.
    drift : float [m]
        How far the source moved, at 17 m from its origin; NaN without planes.
    """

    forward: LocalPlanes
    backward: LocalPlanes
    surface: LocalPlanes
    observability: Observability | None
    refinement_shift: float


def refine_pose(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose
) -> Refinement:
    """Return where a pose comes to rest, target from source in their local frames."""
    forward, backward = _probed(target, source, pose)
    surface = joined([forward, backward])
    footing = plane_constraints(surface, pose.translation)
    rest = pose
    for _ in range(_MOST_STEPS):
        if footing is None:
            return Refinement(forward, backward, surface, None, math.nan)
        step = footing.step()
        rest = Pose(exp_rotation(step[3:]) @ rest.rotation, rest.translation + step[:3])
        if _length(step[:3], step[3:]) < _SMALL_STEP:
            break
        surface = joined(_probed(target, source, rest))
        footing = plane_constraints(surface, rest.translation)
    observability = None if footing is None else observability_of(footing, target.held)
    turn = log_rotation(rest.rotation @ pose.rotation.T)
    refinement_shift = _length(rest.translation - pose.translation, turn)
    return Refinement(forward, backward, surface, observability, refinement_shift)


def _probed(
    target: VerificationFeatures, source: VerificationFeatures, pose: Pose
) -> tuple[LocalPlanes, LocalPlanes]:
    forward = PROBER.fit(target.cell_list, pose.apply(source.query_points))
    backward = PROBER.fit(source.cell_list, pose.inverse().apply(target.query_points))
    return forward, backward.reversed(pose)


def _length(shift: Vector, turn: Vector) -> float:
    return math.hypot(*shift, *(_ROTATION_SCALE * turn))
