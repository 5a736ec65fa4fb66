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
from scanlock.registration.verification.features import PROBER, Evidence
from scanlock.registration.verification.local_planes import ProbedSurface, joined
from scanlock.registration.verification.observability import Hold, hold_of
from scanlock.registration.verification.plane_constraints import footing_at

_MOST_STEPS = 4
"""Three mostly do; where four do not, the pose is wrong, or held by nothing."""

_SMALL_STEP = 0.02
"""After a step shorter than this [m] the planes are the same: no probing anew is worth it."""

_LEVER = 0.3 / math.radians(1.0)
"""Where a rotation counts as a distance [m]: a pose may be off by 0.3 m or by a degree to count as
right, which is 17 m away the same."""


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
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

    ahead: ProbedSurface
    back: ProbedSurface
    surface: ProbedSurface
    hold: Hold | None
    drift: float


def settle(target: Evidence, source: Evidence, pose: Pose) -> Settled:
    """Return where a pose comes to rest, target from source in their local frames."""
    ahead, back = _probed(target, source, pose)
    surface = joined([ahead, back])
    footing = footing_at(surface, pose.translation)
    rest = pose
    for _ in range(_MOST_STEPS):
        if footing is None:
            return Settled(ahead, back, surface, None, math.nan)
        step = footing.step()
        rest = Pose(exp_rotation(step[3:]) @ rest.rotation, rest.translation + step[:3])
        if _length(step[:3], step[3:]) < _SMALL_STEP:
            break
        surface = joined(_probed(target, source, rest))
        footing = footing_at(surface, rest.translation)
    hold = None if footing is None else hold_of(footing, target.held)
    turn = log_rotation(rest.rotation @ pose.rotation.T)
    drift = _length(rest.translation - pose.translation, turn)
    return Settled(ahead, back, surface, hold, drift)


def _probed(target: Evidence, source: Evidence, pose: Pose) -> tuple[ProbedSurface, ProbedSurface]:
    ahead = PROBER.probe(target.listed, pose.apply(source.probes))
    back = PROBER.probe(source.listed, pose.inverse().apply(target.probes))
    return ahead, back.seen_back(pose)


def _length(shift: Vector, turn: Vector) -> float:
    return math.hypot(*shift, *(_LEVER * turn))
