import math
from dataclasses import replace

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints, PosePrior
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.registration.methods.protocol import InsufficientData, PreparationLog
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


def _solution(scans, method=_AUTO, **options):
    prepared = [method.prepare(PointCloud.from_array(scan)) for scan in scans]
    return method.align(*prepared, **options)


def _assert_true(pose, metres=0.05, degrees=0.2):
    assert pose.is_close(_TRUTH, translation=metres, rotation=math.radians(degrees))


@pytest.mark.slow
def test_distant_scans_with_any_heading_are_registered():
    pair = scan_pair("street", "os1_64", 3, baseline=(20.0, 25.0), turn=math.pi)
    result = register(source=pair.source.points, target=pair.target.points)
    assert result.status is Status.OK
    metres, radians = result.target_from_source.distance(pair.target_from_source)
    assert metres < 0.1
    assert math.degrees(radians) < 0.3


def test_candidates_are_sorted_and_the_first_is_chosen(scans):
    solution = _solution(scans)
    best = solution.candidates[0]
    _assert_true(solution.pose)
    assert best.target_from_source == solution.pose
    assert best.proposed_by == "BEV correlation"
    assert best.agreement > 0.5
    assert best.free_space_violation < 0.2
    agreements = [one.agreement for one in solution.candidates]
    assert agreements == sorted(agreements, reverse=True)


def test_an_accurate_initial_pose_is_kept(scans):
    solution = _solution(scans, start=yaw_pose(0.01, (0.1, 0.0, 0.0)) @ _TRUTH)
    _assert_true(solution.pose)
    assert solution.candidates[0].proposed_by == "initial pose"


def test_fine_ndt_is_not_repeated_for_a_start_near_a_refined_hypothesis(scans, monkeypatch):
    calls = []

    def align(self, target, source, start, constraints, original=FineNdt.align):
        calls.append(original(self, target, source, start, constraints))
        return calls[-1]

    monkeypatch.setattr(FineNdt, "align", align)
    searched = _solution(scans)
    without_start = len(calls)
    near = _solution(scans, start=yaw_pose(0.01, (0.1, 0.0, 0.0)) @ _TRUTH)
    assert len(calls) == 2 * without_start
    assert near.pose == searched.pose
    # From farther away SGC-NDT converges to the same pose; fine NDT alone may not.
    far = _solution(scans, start=yaw_pose(0.1, (2.0, 0.0, 0.0)) @ _TRUTH)
    assert len(calls) == 3 * without_start + 1
    _assert_true(far.pose)


def test_a_wrong_initial_pose_does_no_harm(scans):
    solution = _solution(scans, start=yaw_pose(0.5, (-300.0, 100.0, 0.0)))
    _assert_true(solution.pose)
    assert solution.candidates[0].proposed_by == "BEV correlation"


def test_an_initial_pose_decides_between_equal_scores():
    # The scene repeats after half a turn, so only the initial pose distinguishes the two poses.
    half = yaw_pose(math.pi, (0.0, 0.0, 0.0))
    target = np.vstack([street(1), half.apply(street(3))])
    source = np.vstack([street(2), half.apply(street(4))])
    for truth in (Pose.identity(), half):
        initial = yaw_pose(0.1, (1.0, 0.5, 0.0)) @ truth
        solution = _solution((target, source), start=initial)
        assert solution.pose.is_close(truth, translation=0.05, rotation=0.01)
        # The initial pose may be wrong, so the result is ambiguous all the same.
        result = register(source=source, target=target, initial=initial)
        assert result.status is Status.AMBIGUOUS
    result = register(source=source, target=target)
    assert result.status is Status.AMBIGUOUS
    assert "another pose has" in result.reason
    assert result.runner_up_ratio > 0.9
    assert len(result.candidates) >= 2
    assert "BEV correlation" in result.as_dict()["candidates"][1].values()


def test_locked_directions_are_locked_in_hypotheses_too(scans):
    solution = _solution(scans, constraints=Constraints(dof="xy+yaw"))
    assert solution.pose.translation[2] == pytest.approx(0.0, abs=1e-9)
    assert solution.pose.rotation[2, 2] == pytest.approx(1.0, abs=1e-12)
    metres, radians = solution.pose.distance(_TRUTH)
    assert metres < 0.15
    assert math.degrees(radians) < 0.3


def test_a_prior_is_a_hypothesis_and_part_of_the_score():
    half = yaw_pose(math.pi, (0.0, 0.0, 0.0))
    target = np.vstack([street(1), half.apply(street(3))])
    source = np.vstack([street(2), half.apply(street(4))])
    for truth in (Pose.identity(), half):
        prior = PosePrior.from_deviations(yaw_pose(0.1, (0.5, 0.0, 0.0)) @ truth, 0.5, 0.2)
        solution = _solution((target, source), constraints=Constraints(prior=prior))
        assert solution.pose.is_close(truth, translation=0.06, rotation=0.01)
        assert register(source=source, target=target, prior=prior).status is Status.OK


@pytest.mark.parametrize("part", ["search", "fallback_search", "range_imager", "fine"])
def test_every_step_can_be_disabled(scans, part):
    solution = _solution(scans, replace(_AUTO, **{part: None}), start=_TRUTH)
    _assert_true(solution.pose, metres=0.1, degrees=0.3)


def test_scans_without_clusters_are_registered_from_an_initial_pose():
    # Bare ground with gentle hills, without obstacles.
    rng = np.random.default_rng(0)
    xy = rng.uniform(-25.0, 25.0, (2, 12000, 2))
    hills = [
        np.column_stack([one, 0.4 * np.sin(0.35 * one[:, 0]) * np.cos(0.3 * one[:, 1]) - 1.7])
        for one in xy
    ]
    start = yaw_pose(0.02, (0.3, -0.2, 0.1))
    solution = _solution(hills, start=start)
    assert solution.pose.is_close(Pose.identity(), translation=0.1, rotation=0.01)
    # The verification takes voxels of the ground in place of clusters.
    assert solution.candidates[0].agreement > 0.5


def test_too_few_clusters_and_cells_are_insufficient():
    log = PreparationLog()
    with pytest.raises(InsufficientData, match=r"has 0 Gaussians .*, and \d Gaussians of small"):
        _AUTO.prepare(PointCloud.from_array(np.eye(3)), log)
    assert log.notes == []


def test_preparation_is_logged(scans):
    log = PreparationLog()
    data = _AUTO.prepare(PointCloud.from_array(scans[0]), log)
    assert set(log.seconds) == {"ground", "obstacles", "clusters", "bev", "features", "cells"}
    assert log.features is data.features
    assert log.notes == [*data.clusters.notes, f"{len(data.fine.gaussians)} cells of 2 m"]


def test_agreement_decreases_with_the_free_space_violation():
    candidate = Candidate(
        target_from_source=Pose.identity(),
        proposed_by="prior",
        overlap=0.8,
        target_overlap=0.7,
        score=0.5,
        free_space_violation=0.0,
    )
    assert candidate.agreement == pytest.approx(0.4)
    worst = replace(candidate, free_space_violation=MAX_FREE_SPACE_VIOLATION)
    assert worst.agreement == pytest.approx(0.2)
    unknown = replace(candidate, free_space_violation=math.nan)
    assert unknown.agreement == pytest.approx(0.4)
    factors = [plausibility(violation) for violation in (0.0, 0.1, 0.5, 1.0)]
    assert factors == sorted(factors, reverse=True)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"initial_pose_preference": 0.5}, "initial_pose_preference must be"),
        ({"fallback_threshold": 2.0}, "fallback_threshold must lie"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Auto(**settings)
