"""Poses similar to a pose, and the judgement among poses with similar scores."""

import math
from dataclasses import replace

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.auto.data import AutoPair
from scanlock.registration.methods.auto.judgement import judged_poses
from scanlock.registration.methods.auto.multi_start import RefinedHypothesis
from scanlock.registration.methods.auto.ranking import ranked_poses, score_pose
from scanlock.registration.methods.auto.similar_poses import similar_hypotheses
from scanlock.registration.verification.candidate import INITIAL

_AUTO = Auto()
_PERIOD = 6.0


def _row(seed, parked=()):
    """Two rows of columns along x with level ground, and boxes of the size of cars between them."""
    rng = np.random.default_rng(seed)
    ground = np.column_stack([rng.uniform(-30, 30, (9000, 2)), np.full(9000, -1.7)])
    angles, heights = rng.uniform(0, 2 * np.pi, (22, 400)), rng.uniform(-1.7, 2.5, (22, 400))
    columns = [
        np.column_stack([x + 0.3 * np.cos(a), y + 0.3 * np.sin(a), h])
        for (x, y), a, h in zip(
            ((_PERIOD * i, side) for i in range(-5, 6) for side in (-4.0, 4.0)),
            angles,
            heights,
            strict=True,
        )
    ]
    cars = [
        rng.uniform((x - 2, y - 0.9, -1.5), (x + 2, y + 0.9, -0.2), (900, 3)) for x, y in parked
    ]
    points = np.vstack([ground, *columns, *cars])
    return points + rng.normal(0.0, 0.01, points.shape)


def _pair(target, source):
    prepared = [_AUTO.prepare(PointCloud.from_array(scan)) for scan in (target, source)]
    return AutoPair(target=prepared[0], source=prepared[1], initial=None, constraints=UNCONSTRAINED)


def test_similar_poses_are_a_period_or_half_a_turn_away():
    pose = yaw_pose(0.4, (1.0, 0.5, 0.0))
    hypotheses = similar_hypotheses(_pair(_row(0), pose.inverse().apply(_row(1))), pose)
    for x in (_PERIOD, -_PERIOD):
        moved = Pose(np.eye(3), np.array([x, 0.0, 0.0])) @ pose
        assert any(one.pose.is_close(moved, translation=0.4, rotation=0.02) for one in hypotheses)
    turns = [pose.distance(one.pose)[1] for one in hypotheses]
    assert max(turns) == pytest.approx(math.pi, abs=1e-6)


def test_objects_that_stay_exclude_similar_poses():
    rng = np.random.default_rng(0)
    spots = rng.uniform(-22.0, 22.0, (40, 2))
    parked = [spot for spot in spots if abs(spot[1]) > 7.0][:14]
    pair = _pair(_row(2, parked), _row(3, parked))
    assert similar_hypotheses(pair, Pose.identity()) == []


def _scored(pair, pose, proposed_by="BEV correlation"):
    solution = _AUTO.fine.align(pair.target.fine, pair.source.fine, pose, UNCONSTRAINED)
    refined = RefinedHypothesis(proposed_by=proposed_by, solution=solution)
    return score_pose(pair, refined, _AUTO.initial_pose_preference)


def test_the_most_probable_of_similar_poses_is_chosen():
    parked = [(-11.0, -8.0), (4.0, 8.0), (13.0, -8.0)]
    pair = _pair(_row(4, parked), _row(5, parked))
    scored = [_scored(pair, Pose(np.eye(3), np.array([x, 0.0, 0.0]))) for x in (_PERIOD, 0.0)]
    judged = judged_poses(pair, ranked_poses(scored, (0.5, 0.05)))
    chances = [one.candidate.probability for one in judged]
    assert chances == sorted(chances, reverse=True)
    assert judged[0].solution.pose.is_close(Pose.identity(), translation=0.1, rotation=0.02)
    assert chances[1] < chances[0]


def test_a_single_pose_is_not_judged():
    pair = _pair(_row(6), _row(7))
    scored = [_scored(pair, Pose.identity())]
    judged = judged_poses(pair, scored)
    assert judged == scored
    assert math.isnan(judged[0].candidate.probability)


def test_negative_scores_keep_their_order_without_a_judgement():
    # A distant prior makes scores negative; one pose alone has a similar score.
    pair = _pair(_row(10), _row(11))
    shift = Pose(np.eye(3), np.array([_PERIOD, 0.0, 0.0]))
    best = replace(_scored(pair, Pose.identity()), score=-1.0)
    other = replace(_scored(pair, shift), score=-5.0)
    assert judged_poses(pair, [best, other]) == [best, other]
    initial = replace(_scored(pair, shift, INITIAL), score=-5.0)
    judged = judged_poses(pair, [best, initial])
    assert not any(math.isnan(one.candidate.probability) for one in judged)


def test_of_two_equal_poses_the_initial_one_is_kept():
    pair = _pair(_row(8), _row(9))
    shift = Pose(np.eye(3), np.array([_PERIOD, 0.0, 0.0]))
    for initial, other in ((shift, Pose.identity()), (Pose.identity(), shift)):
        ranked = ranked_poses([_scored(pair, initial, INITIAL), _scored(pair, other)], (0.5, 0.05))
        judged = judged_poses(pair, ranked)
        difference = judged[0].candidate.probability - judged[1].candidate.probability
        assert judged[0].candidate.proposed_by == INITIAL or difference > 0.1
