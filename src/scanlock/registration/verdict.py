"""Whether a pose can be trusted: overlap, score, and the status that follows."""

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.kernels.meeting import meeting_gaussians
from scanlock.models.gaussians import Gaussians
from scanlock.objectives.gaussian_scores import GaussiansToGaussians
from scanlock.registration.result import Status
from scanlock.solvers.newton import Solution
from scanlock.solvers.stopping import StopReason

_MEETING_SQUARED = 9.0
"""Two parts meet within three standard deviations of their difference."""


def gaussian_overlap(target: Gaussians, source: Gaussians, pose: Pose) -> float:
    """Return the share of the source's Gaussians, by weight, that meet one of the target.

    Two Gaussians meet when the squared Mahalanobis distance of their means, under the sum of
    their covariances, is below 9.
    """
    moved = source.transformed(pose)
    met = meeting_gaussians(
        target.means,
        target.packed_covariances,
        target.widths,
        moved.means,
        moved.packed_covariances,
        source.widths,
        _MEETING_SQUARED,
    )
    squares = source.weights**2
    return float(squares[met].sum() / squares.sum())


def score_correlation(target: Gaussians, source: Gaussians, pose: Pose) -> float:
    """Return the D2D score at a pose over the geometric mean of the scans' self-scores."""
    identity = Pose.identity()
    cross = GaussiansToGaussians(target=target, source=source).linearise(pose).value
    own = [
        GaussiansToGaussians(target=one, source=one).linearise(identity).value
        for one in (target, source)
    ]
    return cross / -float(np.sqrt(own[0] * own[1]))


def judge(solution: Solution, overlap: float, least_overlap: float) -> tuple[Status, str]:
    """Return the status of a solution and the sentence that explains it."""
    if solution.reason is StopReason.NO_SUPPORT:
        return Status.NO_SUPPORT, solution.reason.value
    if not solution.reason.is_converged:
        return Status.NOT_CONVERGED, solution.reason.value
    if overlap < least_overlap:
        return Status.LOW_OVERLAP, (
            f"only {overlap:.0%} of the source meets the target, less than {least_overlap:.0%}; "
            "the pose is likely wrong, or the scans hardly overlap"
        )
    return Status.OK, f"{solution.reason.value}; {overlap:.0%} of the source meets the target"
