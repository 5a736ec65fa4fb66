import math
from dataclasses import replace

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.registration.methods.auto import Auto
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.register import register
from scanlock.registration.verification.candidate import (
    MAX_FREE_SPACE_VIOLATION,
    Candidate,
    plausibility,
)
from scanlock.registration.verification.status import Status
from scanlock.simulation import scan_pair

_AUTO = Auto()
_TRUTH = yaw_pose(2.2, (6.0, -3.0, 0.1))


@pytest.fixture(scope="module")
def scans():
    """Target and source."""
    return street(1), _TRUTH.inverse().apply(street(2))


def _found(scans, method=_AUTO, **options):
    kept = [method.prepare(PointCloud.from_array(scan)) for scan in scans]
    return method.find(*kept, **options)


def _assert_true(pose, metres=0.05, degrees=0.2):
    assert pose.is_close(_TRUTH, translation=metres, rotation=math.radians(degrees))


def test_a_scan_far_apart_with_any_heading_is_found():
    pair = scan_pair("street", "os1_64", 5, baseline=(20.0, 25.0), turn=math.pi)
    result = register(source=pair.source.points, target=pair.target.points)
    assert result.status is Status.OK
    metres, radians = result.target_from_source.distance(pair.target_from_source)
    assert metres < 0.1
    assert math.degrees(radians) < 0.3


def test_candidates_tell_what_there_was_to_choose_from(scans):
    found = _found(scans)
    best = found.candidates[0]
    _assert_true(found.solution.pose)
    assert best.target_from_source == found.solution.pose
    assert best.proposed_by == "heading search"
    assert best.agreement > 0.5
    assert best.free_space_violation < 0.2
    agreements = [one.agreement for one in found.candidates]
    assert agreements == sorted(agreements, reverse=True)


def test_a_good_initial_pose_is_never_made_worse(scans):
    found = _found(scans, initial=yaw_pose(0.01, (0.1, 0.0, 0.0)) @ _TRUTH)
    _assert_true(found.solution.pose)
    assert found.candidates[0].proposed_by == "initial pose"


def test_a_start_from_where_the_search_leads_is_not_finished_again(scans, monkeypatch):
    ends = []

    def align(self, target, source, start, constraints, kept=FineNdt.align):
        ends.append(kept(self, target, source, start, constraints))
        return ends[-1]

    monkeypatch.setattr(FineNdt, "align", align)
    searched = _found(scans)
    alone = len(ends)
    near = _found(scans, initial=yaw_pose(0.01, (0.1, 0.0, 0.0)) @ _TRUTH)
    assert len(ends) == 2 * alone
    assert near.solution.pose == searched.solution.pose
    # Farther away, the basin still leads there; straight from the start may lead elsewhere.
    far = _found(scans, initial=yaw_pose(0.1, (2.0, 0.0, 0.0)) @ _TRUTH)
    assert len(ends) == 3 * alone + 1
    _assert_true(far.solution.pose)


def test_a_wrong_initial_pose_misleads_nobody(scans):
    found = _found(scans, initial=yaw_pose(0.5, (-300.0, 100.0, 0.0)))
    _assert_true(found.solution.pose)
    assert found.candidates[0].proposed_by == "heading search"


def test_loyalty_decides_between_poses_that_agree_as_well():
    # A world that looks the same after half a turn: only the initial pose knows which it is.
    half = yaw_pose(math.pi, (0.0, 0.0, 0.0))
    target = np.vstack([street(1), half.apply(street(3))])
    source = np.vstack([street(2), half.apply(street(4))])
    for truth in (Pose.identity(), half):
        found = _found((target, source), initial=yaw_pose(0.1, (1.0, 0.5, 0.0)) @ truth)
        assert found.solution.pose.is_close(truth, translation=0.05, rotation=0.01)
        # It may be wrong, so that the twin is told all the same.
        told = register(
            source=source, target=target, initial=yaw_pose(0.1, (1.0, 0.5, 0.0)) @ truth
        )
        assert told.status is Status.AMBIGUOUS
    result = register(source=source, target=target)
    assert result.status is Status.AMBIGUOUS
    assert "another pose has" in result.reason
    assert result.runner_up_ratio > 0.9
    assert len(result.candidates) >= 2
    assert result.as_dict()["candidates"][1]["maker"] == "heading search"


def test_locked_directions_hold_for_hypotheses_too(scans):
    target, source = scans
    level = Constraints(dof="xy+yaw")
    found = _found((target, source), constraints=level)
    assert found.solution.pose.translation[2] == pytest.approx(0.0, abs=1e-9)
    assert found.solution.pose.rotation[2, 2] == pytest.approx(1.0, abs=1e-12)
    metres, radians = found.solution.pose.distance(_TRUTH)
    assert metres < 0.15
    assert math.degrees(radians) < 0.3


def test_a_prior_is_a_hypothesis_and_a_judge():
    half = yaw_pose(math.pi, (0.0, 0.0, 0.0))
    target = np.vstack([street(1), half.apply(street(3))])
    source = np.vstack([street(2), half.apply(street(4))])
    for truth in (Pose.identity(), half):
        believed = PosePrior.from_deviations(yaw_pose(0.1, (0.5, 0.0, 0.0)) @ truth, 0.5, 0.2)
        found = _found((target, source), constraints=Constraints(prior=believed))
        assert found.solution.pose.is_close(truth, translation=0.06, rotation=0.01)
        assert register(source=source, target=target, prior=believed).status is Status.OK


@pytest.mark.parametrize("part", ["search", "deeper", "imager", "fine"])
def test_every_part_can_be_left_out(scans, part):
    found = _found(scans, replace(_AUTO, **{part: None}), initial=_TRUTH)
    _assert_true(found.solution.pose, metres=0.1, degrees=0.3)


def test_without_parts_to_search_by_a_start_is_enough():
    # Bare ground with gentle hills: nothing stands on it.
    rng = np.random.default_rng(0)
    xy = rng.uniform(-25.0, 25.0, (2, 12000, 2))
    hills = [
        np.column_stack([one, 0.4 * np.sin(0.35 * one[:, 0]) * np.cos(0.3 * one[:, 1]) - 1.7])
        for one in xy
    ]
    start = yaw_pose(0.02, (0.3, -0.2, 0.1))
    found = _found(hills, initial=start)
    assert found.solution.pose.is_close(Pose.identity(), translation=0.1, rotation=0.01)
    # What there is of parts are cubes of the ground, and they agree.
    assert found.candidates[0].agreement > 0.5


def test_agreement_falls_with_what_violates_free_space():
    sure = Candidate(
        target_from_source=Pose.identity(), proposed_by="prior", overlap=0.8, target_overlap=0.7,
        score=0.5, free_space_violation=0.0,
    )  # fmt: skip
    assert sure.agreement == pytest.approx(0.4)
    assert replace(sure, free_space_violation=MAX_FREE_SPACE_VIOLATION).agreement == pytest.approx(
        0.2
    )
    assert replace(sure, free_space_violation=math.nan).agreement == pytest.approx(0.4)
    shares = [plausibility(violation) for violation in (0.0, 0.1, 0.5, 1.0)]
    assert shares == sorted(shares, reverse=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"loyalty": 0.5}, "loyalty must be"), ({"doubt": 2.0}, "doubt must lie")],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Auto(**settings)
