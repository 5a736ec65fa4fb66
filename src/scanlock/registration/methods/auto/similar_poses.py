"""Hypotheses similar to a pose: one period or half a turn away, where the scans may agree too."""

import math

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.methods.auto.data import AutoPair
from scanlock.registration.search.hypothesis import Hypothesis
from scanlock.registration.verification.object_odds import DECISIVE_LOG_ODDS, object_log_odds
from scanlock.registration.verification.self_similarity import common_periods


def similar_hypotheses(pair: AutoPair, pose: Pose) -> list[Hypothesis]:
    """Propose the source displaced by each period of both scans, and turned by half a turn.

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
    _, periods = common_periods(target.self_similarity, source.self_similarity, pose)
    if object_log_odds(target, source, pose, periods) >= DECISIVE_LOG_ODDS:
        return []
    displaced = [Pose(pose.rotation, pose.translation + period) for period in periods]
    up = target.low_objects.occupied.rotation[2]
    turned = Pose(exp_rotation(math.pi * up) @ pose.rotation, pose.translation)
    return [
        Hypothesis(pose=one, score=1.0, proposed_by="similar pose") for one in (*displaced, turned)
    ]
