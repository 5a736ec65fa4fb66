"""A pose looked at from all sides: what the verdict and the probability are made of."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.registration.verification.agreement import candidate_at
from scanlock.registration.verification.candidate import Candidate, runner_up_ratio
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.local_planes import joined
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability, Observability
from scanlock.registration.verification.overlap import slide_ratio
from scanlock.registration.verification.refinement import refine_pose

_LEAST_SLIDE = 0.75
"""A source slid by less [m] is no rival: parts are about as wide as that."""


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
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
    observability: Observability | None
    runner_up: float = math.nan
    slide_ratio: float = math.nan

    @property
    def directions(self) -> tuple[DirectionObservability, ...]:
        """The directions of the hold, or none."""
        return () if self.observability is None else self.observability.directions

    @property
    def degenerate(self) -> tuple[DirectionObservability, ...]:
        """The directions that nothing holds."""
        return () if self.observability is None else self.observability.degenerate

    def fix_degenerate(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its weak directions as in the prior; see `Observability`."""
        return (
            pose if self.observability is None else self.observability.fix_degenerate(pose, prior)
        )


def assess_pose(
    target: VerificationFeatures,
    source: VerificationFeatures,
    pose: Pose,
    candidates: Sequence[Candidate] = (),
    runner_up: float = math.nan,
) -> Assessment:
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
    settled = refine_pose(target, source, pose)
    has_plane, observability = settled.forward.has_plane, settled.observability
    slides = [
        slide_ratio(target.gaussians, source.gaussians, pose, one.axis, _LEAST_SLIDE)
        for one in (() if observability is None else observability.directions[:2])
    ]
    return Assessment(
        Metrics(
            overlap=chosen.overlap,
            target_overlap=chosen.target_overlap,
            score=chosen.score,
            inlier_rmse=joined([settled.forward, settled.backward]).roughness,
            roughness=math.hypot(target.roughness, source.roughness) / math.sqrt(2.0),
            outlier_ratio=settled.surface.outlier_ratio,
            fitness=float(np.mean(has_plane)) if len(has_plane) else math.nan,
            refinement_shift=settled.refinement_shift,
            violation=chosen.violation,
            runner_up_ratio=_most([runner_up_ratio(candidates), *slides]),
        ),
        observability,
        runner_up,
        _most(slides),
    )


def _most(shares: Sequence[float]) -> float:
    """Return the largest that is known, NaN without any."""
    return max((ratio for ratio in shares if not math.isnan(ratio)), default=math.nan)
