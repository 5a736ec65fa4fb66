"""Hypotheses similar to a pose, where the scans may agree too: one period or half a turn away."""

from scanlock.geometry.pose import Pose
from scanlock.registration.methods.auto.data import AutoPair
from scanlock.registration.search.hypothesis import Hypothesis
from scanlock.registration.verification.object_odds import DECISIVE_LOG_ODDS, object_log_odds
from scanlock.registration.verification.self_similarity import self_matches


def similar_hypotheses(pair: AutoPair, pose: Pose) -> list[Hypothesis]:
    """Propose the source moved by each motion at which both scans correlate with themselves.

    Parameters
    ----------
    pair : AutoPair
    pose : Pose
        The best pose.

    Returns
    -------
    list of Hypothesis
        Empty if the low objects exclude look-alikes.
    """
    target, source = pair.target.features, pair.source.features
    similarity, motions = self_matches(target.self_similarity, source.self_similarity, pose)
    if object_log_odds(target, source, pose, motions) >= DECISIVE_LOG_ODDS:
        return []
    return [
        Hypothesis(pose=motion @ pose, score=similarity, proposed_by="similar pose")
        for motion in motions
    ]
