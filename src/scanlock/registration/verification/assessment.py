"""A pose looked at from all sides: what the verdict and the probability are made of."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.registration.verification.agreement import candidate_at
from scanlock.registration.verification.candidate import Candidate, second_best
from scanlock.registration.verification.features import Evidence
from scanlock.registration.verification.local_planes import joined
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import HeldDirection, Hold
from scanlock.registration.verification.overlap import slide_rivalry
from scanlock.registration.verification.refinement import settle

_LEAST_SLIDE = 0.75
"""A source slid by less [m] is no rival: parts are about as wide as that."""


@dataclass(frozen=True, slots=True, eq=False)
class Inspection:
    """What two scans say about a pose between them.

    Attributes
    ----------
    metrics : Metrics
    hold : Hold or None
        How firmly the surfaces they share hold it, where it comes to rest on them; None where they
        share too few.
    rival : float
        How well another pose that a search finished stands, as a share, by what the choice
        was made by; NaN without a search.
    slide : float
        How well the source agrees slid along what holds it least, as a share; NaN if unknown.
    """

    metrics: Metrics
    hold: Hold | None
    rival: float = math.nan
    slide: float = math.nan

    @property
    def directions(self) -> tuple[HeldDirection, ...]:
        """The directions of the hold, or none."""
        return () if self.hold is None else self.hold.directions

    @property
    def weak(self) -> tuple[HeldDirection, ...]:
        """The directions that nothing holds."""
        return () if self.hold is None else self.hold.weak

    def given_back(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its weak directions as in the prior; see `Hold`."""
        return pose if self.hold is None else self.hold.given_back(pose, prior)


def inspect(
    target: Evidence,
    source: Evidence,
    pose: Pose,
    candidates: Sequence[Candidate] = (),
    rival: float = math.nan,
) -> Inspection:
    """Return what two scans say about a pose, target from source in their local frames.

    Parameters
    ----------
    target, source : Evidence
    pose : Pose
    candidates : sequence of Candidate
        Where a search chose the pose, what it chose from, the chosen one first.
    rival : float
        How well the second of them stands, as a share of the first.
    """
    chosen = candidates[0] if candidates else candidate_at(target, source, pose, "")
    settled = settle(target, source, pose)
    met, hold = settled.ahead.met, settled.hold
    slides = [
        slide_rivalry(target.gaussians, source.gaussians, pose, one.axis, _LEAST_SLIDE)
        for one in (() if hold is None else hold.directions[:2])
    ]
    return Inspection(
        Metrics(
            overlap=chosen.overlap,
            target_overlap=chosen.target_overlap,
            score=chosen.score,
            inlier_rmse=joined([settled.ahead, settled.back]).roughness,
            roughness=math.hypot(target.roughness, source.roughness) / math.sqrt(2.0),
            misfit=settled.surface.misfit,
            surface_overlap=float(np.mean(met)) if len(met) else math.nan,
            drift=settled.drift,
            violation=chosen.violation,
            second_best=_most([second_best(candidates), *slides]),
        ),
        hold,
        rival,
        _most(slides),
    )


def _most(shares: Sequence[float]) -> float:
    """Return the largest that is known, NaN without any."""
    return max((share for share in shares if not math.isnan(share)), default=math.nan)
