import json
import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.errors import InvalidInput
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.register import register
from scanlock.registration.registry import DEFAULT_METHOD, METHODS
from scanlock.registration.verification.status import Status


@pytest.fixture(scope="module")
def scan():
    return street(1, 3000)


def test_the_default_method_has_a_name(scan):
    assert register(source=scan, target=scan).method == DEFAULT_METHOD
    assert DEFAULT_METHOD in METHODS


@pytest.mark.parametrize(
    ("initial", "message"),
    [
        (np.zeros((2, 2)), "initial must have shape"),
        (2.0 * np.eye(4), "the last row of initial must be 0 0 0 1"),
        (np.diag([1.0, 1.0, -1.0, 1.0]), "must be a rotation"),
        (np.full((4, 4), np.nan), "must be finite"),
        ("identity", "must hold real numbers"),
    ],
)
def test_an_invalid_initial_pose_is_refused(scan, initial, message):
    with pytest.raises(InvalidInput, match=message):
        register(source=scan, target=scan, initial=initial)


def test_an_initial_pose_with_few_digits_is_corrected_and_noted(scan):
    exact = yaw_pose(0.3, (0.1, 0.2, 0.0)).matrix
    notes = {
        digits: _initial_notes(register(source=scan, target=scan, initial=exact.round(digits)))
        for digits in (3, 12)
    }
    assert not notes[12]
    [note] = notes[3]
    defect = float(note.split(" was ")[1].split()[0])
    assert 1e-5 < defect < 1e-3
    assert not _initial_notes(register(source=scan, target=scan))


def _initial_notes(result):
    return [note for note in result.notes if note.startswith("initial")]


def test_the_pose_maps_the_source_onto_the_target(scan):
    motion = yaw_pose(0.3, (3.0, 1.0, 0.0))
    result = register(source=motion.inverse().apply(scan), target=scan)
    moved = result.target_from_source.apply(motion.inverse().apply(scan))
    assert np.median(np.linalg.norm(moved - scan, axis=1)) < 0.1


def test_the_reason_names_the_scan_with_too_few_gaussians(scan):
    result = register(source=scan[:3], target=scan)
    assert result.status is Status.NO_CORRESPONDENCES
    assert result.reason.startswith("the source has 0 Gaussians")


def test_a_method_runs_where_the_pose_cannot_be_verified():
    # One small object: enough for closest points, too few Gaussians for the verification.
    box = np.random.default_rng(0).uniform([4.6, 4.6, 0.1], [5.9, 5.9, 1.4], (400, 3))
    result = register(source=box - [0.0, 0.0, 0.05], target=box, method="icp")
    assert result.status is Status.UNVERIFIED
    assert result.reason.startswith("the pose cannot be verified: the target has only")
    assert math.isnan(result.probability)
    assert len(result.history) > 1


def test_settings_are_named_after_their_class(scan):
    class Renamed(type(METHODS[DEFAULT_METHOD])):
        """The default method under another name."""

    assert register(source=scan, target=scan, method=Renamed()).method == "Renamed"


def test_source_and_target_are_keyword_only(scan):
    with pytest.raises(TypeError, match="positional"):
        register(scan, scan)


def test_without_verification_the_pose_is_unverified(scan):
    result = register(source=scan, target=scan, method="gicp", verify=False)
    assert result.status is Status.UNVERIFIED
    assert result.converged
    assert not result
    assert math.isnan(result.probability)
    assert not {"features", "verification"} & set(result.timings)
    checked = register(source=scan, target=scan, method="gicp")
    assert checked.target_from_source == result.target_from_source
    assert json.loads(result.to_json())["probability"] is None


def test_degenerate_directions_are_not_fixed_without_verification(scan):
    with pytest.raises(InvalidInput, match="leave out verify=False"):
        register(source=scan, target=scan, initial=np.eye(4), fix_degenerate=True, verify=False)


def test_without_verification_a_scan_without_clusters_can_be_registered():
    rng = np.random.default_rng(0)
    plane = np.column_stack([rng.uniform(-5.0, 5.0, (400, 2)), 0.3 * rng.normal(size=400)])
    result = register(source=plane, target=plane, method="icp", verify=False)
    assert result.status is Status.UNVERIFIED


@pytest.mark.parametrize(
    ("method", "message"),
    [
        ("gcip", "did you mean 'gicp'"),
        (Gicp, r"write Gicp\(\)"),
        (3, "int without prepare and align"),
    ],
)
def test_an_unknown_method_is_refused_with_a_remedy(scan, method, message):
    with pytest.raises(InvalidInput, match=message):
        register(source=scan, target=scan, method=method)


def test_method_names_ignore_case(scan):
    assert register(source=scan, target=scan, method="GICP", verify=False).method == "gicp"


def test_the_hessian_is_that_of_the_objective_at_the_pose(scan):
    result = register(source=scan, target=scan, method="gicp", verify=False)
    np.testing.assert_allclose(result.hessian, result.hessian.T)
    assert np.linalg.eigvalsh(result.hessian)[0] > 0.0
