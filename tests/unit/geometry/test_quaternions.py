import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scanlock.errors import InvalidInput
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation

_COMPONENTS = st.lists(st.floats(-1.0, 1.0), min_size=4, max_size=4).filter(
    lambda q: np.linalg.norm(q) > 0.1
)


@given(_COMPONENTS, st.floats(0.991, 1.009))
def test_a_pose_has_the_rotation_of_its_quaternion(components, norm):
    unit = np.array(components) / np.linalg.norm(components)
    pose = pose_from_quaternion((1.0, -2.0, 3.0), (norm * unit).tolist())
    # A quaternion and its negative are the same rotation.
    found = quaternion_from_rotation(pose.rotation)
    assert abs(found @ unit) == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(pose.translation, [1.0, -2.0, 3.0])


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (1.1, 0.0, 0.0, 0.0), (np.nan,) * 4])
def test_other_norms_are_refused(quaternion):
    with pytest.raises(InvalidInput, match="quaternion must have norm 1, got"):
        pose_from_quaternion((0.0, 0.0, 0.0), quaternion)
