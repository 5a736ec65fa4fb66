import math

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock import InvalidInput, Pose
from scanlock.pipelines.starts import AroundTruth, Displaced, FromIdentity
from scanlock.pipelines.study import pose_errors

TRUTH = yaw_pose(0.4, (3.0, -1.0, 0.5))
CENTRE = np.array([40.0, -20.0, 3.0])


def test_identity_starts_need_no_true_pose():
    plan = FromIdentity()
    [name] = plan.names
    assert plan.pose(name, "a b", None, CENTRE) == Pose.identity()


def test_displaced_starts_rotate_about_the_centre_of_the_source():
    motion = yaw_pose(0.3, (1.0, 2.0, 3.0))
    plan = Displaced(motions={"none": Pose.identity(), "far": motion})
    assert plan.names == ("none", "far")
    assert plan.pose("none", "a b", None, CENTRE) == Pose.identity()
    assert plan.pose("far", "a b", TRUTH, np.zeros(3)) == motion
    start = plan.pose("far", "a b", TRUTH, CENTRE)
    np.testing.assert_allclose(start.apply(CENTRE), CENTRE + motion.translation)
    np.testing.assert_array_equal(start.rotation, motion.rotation)


def test_the_rule_of_displaced_starts_identifies_their_motions():
    rules = {
        Displaced(motions={"far": yaw_pose(angle, (1.0, 2.0, 3.0))}).rule
        for angle in (0.3, 0.3, 0.4)
    }
    assert len(rules) == 2


def test_a_plan_without_motions_is_refused():
    with pytest.raises(InvalidInput, match="motions must hold at least one start"):
        Displaced(motions={})


@pytest.mark.parametrize("axis", ["vertical", "random"])
def test_starts_have_exactly_the_given_errors_at_the_centre_of_the_source(axis):
    plan = AroundTruth(distances=(0.0, 2.0), angles=(0.0, 0.5, math.pi), repeats=2, axis=axis)
    assert len(plan.names) == len(set(plan.names)) == 12
    for name, level in plan.levels.items():
        start = plan.pose(name, "a b", TRUTH, CENTRE)
        assert pose_errors(start, TRUTH, CENTRE) == pytest.approx(level, abs=1e-7)


def test_perturbations_are_about_the_vertical_or_in_random_directions():
    levels = {"distances": (5.0,), "angles": (1.0,), "repeats": 20}
    tilts, rises = {}, {}
    for axis in ("vertical", "random"):
        plan = AroundTruth(axis=axis, **levels)
        errors = [plan.pose(name, "a b", Pose.identity(), np.zeros(3)) for name in plan.names]
        tilts[axis] = max(1.0 - pose.rotation[2, 2] for pose in errors)
        rises[axis] = np.median([abs(pose.translation[2]) for pose in errors])
    assert tilts["vertical"] < 1e-12 < 0.1 < tilts["random"]
    assert rises["vertical"] < 1.0 < rises["random"]


def test_a_start_depends_only_on_seed_pair_and_name():
    few = AroundTruth(distances=(2.0,), angles=(0.3,), repeats=1)
    many = AroundTruth(distances=(1.0, 2.0, 3.0), angles=(0.0, 0.3), repeats=3)
    [name] = few.names
    start = few.pose(name, "a b", TRUTH, CENTRE)
    assert many.pose(name, "a b", TRUTH, CENTRE) == start
    other = AroundTruth(distances=(2.0,), angles=(0.3,), seed=1)
    assert other.pose(name, "a b", TRUTH, CENTRE) != start
    assert few.pose(name, "b c", TRUTH, CENTRE) != start


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"distances": ()}, "distances must be strictly ascending"),
        ({"distances": (2.0, 1.0)}, "distances must be strictly ascending"),
        ({"angles": (0.0, 0.0)}, "angles must be strictly ascending"),
        ({"angles": (-0.1,)}, "angles must be at least 0"),
        ({"angles": (4.0,)}, "angles must be at most pi rad"),
        ({"distances": (math.inf,)}, "distances must be at least 0"),
        ({"repeats": 0}, "repeats must be a whole number"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"axis": "sideways"}, "axis must be"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        AroundTruth(**settings)


def test_starts_around_an_unknown_truth_are_refused():
    plan = AroundTruth()
    with pytest.raises(InvalidInput, match="got none for the pair a b"):
        plan.pose(plan.names[0], "a b", None, CENTRE)
