import math

import numpy as np
import pytest

from scanlock import InvalidInput, Pose, Status, assess, prepare, register
from scanlock.simulation import scan_pair

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def pair():
    return scan_pair("street", "hdl_32e", 1)


def test_a_correct_pose_is_ok_and_returned_unchanged(pair):
    result = assess(
        source=pair.source.points, target=pair.target.points, pose=pair.target_from_source
    )
    assert result.ok
    assert result.method == "given pose"
    assert result.target_from_source == pair.target_from_source
    assert result.history == ()
    assert result.reason.endswith(f"probability {result.probability:.3f}")


@pytest.mark.parametrize("step", [(2.0, 0.0, 0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0, 0.0, 0.5)])
def test_a_wrong_pose_is_not_ok(pair, step):
    wrong = Pose.from_step(np.array(step)) @ pair.target_from_source
    result = assess(source=pair.source.points, target=pair.target.points, pose=wrong)
    assert not result
    assert result.probability < 0.5


def test_the_assessment_equals_that_of_register_without_candidates(pair):
    found = register(source=pair.source.points, target=pair.target.points, method="gicp",
                     initial=pair.target_from_source)  # fmt: skip
    again = assess(
        source=pair.source.points, target=pair.target.points, pose=found.target_from_source
    )
    assert again.metrics == found.metrics
    assert again.probability == found.probability
    assert again.status is found.status is Status.OK


def test_prepared_scans_of_any_method_are_accepted(pair):
    scans = prepare(pair.source.points, method="gicp"), prepare(pair.target.points, method="icp")
    result = assess(source=scans[0], target=scans[1], pose=pair.target_from_source)
    plain = assess(
        source=pair.source.points, target=pair.target.points, pose=pair.target_from_source
    )
    assert result.metrics == plain.metrics
    unverified = prepare(pair.source.points, method="gicp", verify=False)
    result = assess(source=unverified, target=scans[1], pose=pair.target_from_source)
    assert result.metrics == plain.metrics


def test_invalid_input_is_refused_and_insufficient_scans_are_a_status(pair):
    with pytest.raises(InvalidInput, match="initial"):
        assess(source=pair.source.points, target=pair.target.points, pose=np.zeros((4, 4)))
    few = np.concatenate([np.full((9, 3), [x, 5.0, 0.0]) for x in (5.0, 15.0)])
    result = assess(source=few, target=pair.target.points, pose=Pose.identity())
    assert result.status is Status.UNVERIFIED
    assert "the source has only 2 clusters or voxels" in result.reason
    assert math.isnan(result.metrics.overlap)
