"""Assessment of a pose: its metrics and its observability, for the probability and the status."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector, short_repr
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.agreement import candidate_at
from scanlock.registration.verification.candidate import Candidate, agreement_ratio
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.registration.verification.local_planes import concatenated
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.object_odds import DECISIVE_LOG_ODDS, object_log_odds
from scanlock.registration.verification.observability import DirectionObservability, Observability
from scanlock.registration.verification.overlap import shifted_score_ratio
from scanlock.registration.verification.refinement import refine_pose
from scanlock.registration.verification.self_similarity import self_matches

_MIN_SHIFT = 0.75
"""Minimum shift of the source [m] that counts as another pose: about the size of a cluster."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Assessment:
    """Metrics and observability of a pose between two scans.

    Attributes
    ----------
    metrics : Metrics
    observability : Observability or None
        Observability of the refined pose; None if the scans share too few planes.
    runner_up_ratio : float
        Ranking value of the second candidate of a search divided by that of the chosen one; NaN
        without a search.
    shifted_score_ratio : float
        Best score of the source shifted along its least constrained directions, divided by the
        score at the pose; 0 if the low objects exclude such places, NaN if unknown.
    overlap_centroid : (3,) or None [m]
        Centroid of the surfaces that both scans share, in the target's local frame; None if they
        share none.
    """

    metrics: Metrics
    observability: Observability | None
    runner_up_ratio: float = math.nan
    shifted_score_ratio: float = math.nan
    overlap_centroid: Vector | None = None

    __repr__ = short_repr

    @property
    def directions(self) -> tuple[DirectionObservability, ...]:
        """Observability of each direction; empty if the scans share too few planes."""
        return () if self.observability is None else self.observability.directions

    @property
    def degenerate(self) -> tuple[DirectionObservability, ...]:
        """Degenerate directions."""
        return () if self.observability is None else self.observability.degenerate

    def fix_degenerate(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its degenerate directions as in the prior; see `Observability`."""
        if self.observability is None:
            return pose
        return self.observability.fix_degenerate(pose, prior)


def assess_pose(
    target: VerificationFeatures,
    source: VerificationFeatures,
    pose: Pose,
    candidates: Sequence[Candidate] = (),
    runner_up_ratio: float = math.nan,
) -> Assessment:
    """Assess a pose, target from source in the local frames of the scans.

    Parameters
    ----------
    target, source : VerificationFeatures
    pose : Pose
    candidates : sequence of Candidate
        Candidates of the search that chose the pose, the chosen one first; empty without a
        search.
    runner_up_ratio : float
        Ranking value of the second candidate divided by that of the first. Unlike their
        agreements, it includes the prior and the preference for the initial pose.
    """
    chosen = candidates[0] if candidates else candidate_at(target, source, pose, "")
    refinement = refine_pose(target, source, pose)
    observability = refinement.observability
    similarity, motions = self_matches(target.self_similarity, source.self_similarity, pose)
    log_odds = object_log_odds(target, source, pose, motions)
    axes = [] if observability is None else [one.axis for one in observability.directions[:2]]
    shifted = (
        # The objects exclude displaced places, without the cost of the scores there.
        [0.0]
        if log_odds >= DECISIVE_LOG_ODDS
        else [
            shifted_score_ratio(target.gaussians, source.gaussians, pose, axis, _MIN_SHIFT)
            for axis in axes
        ]
    )
    has_plane = refinement.target_planes.has_plane
    planes = concatenated([refinement.target_planes, refinement.source_planes])
    return Assessment(
        metrics=Metrics(
            overlap=chosen.overlap,
            target_overlap=chosen.target_overlap,
            score=chosen.score,
            inlier_rmse=planes.rmse,
            roughness=math.hypot(target.roughness, source.roughness) / math.sqrt(2.0),
            outlier_ratio=refinement.refined_planes.outlier_ratio,
            fitness=float(np.mean(has_plane)) if len(has_plane) else math.nan,
            refinement_shift=refinement.refinement_shift,
            free_space_violation=chosen.free_space_violation,
            runner_up_ratio=_max_known([agreement_ratio(candidates), *shifted]),
            object_log_odds=log_odds,
            self_similarity=similarity,
            scale_difference=refinement.scale_difference[0],
            scale_deviation=refinement.scale_difference[1],
        ),
        observability=observability,
        runner_up_ratio=runner_up_ratio,
        shifted_score_ratio=_max_known(shifted),
        overlap_centroid=planes.points.mean(axis=0) if len(planes.points) else None,
    )


def _max_known(ratios: Sequence[float]) -> float:
    """Return the largest number that is not NaN; NaN if there is none."""
    return max((ratio for ratio in ratios if not math.isnan(ratio)), default=math.nan)
