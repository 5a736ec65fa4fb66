import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.linalg import expm

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hat
from scanlock.simulation.motion import carried, screw, twist_between

_twists = arrays(np.float64, 6, elements=st.floats(-3, 3))
_times = st.floats(-1, 1)


@given(twist=_twists, time=_times)
def test_a_screw_is_the_matrix_exponential_of_its_twist(twist, time):
    generator = np.zeros((4, 4))
    generator[:3, :3] = hat(twist[3:])
    generator[:3, 3] = twist[:3]
    [rotation], [translation] = screw(twist, np.array([time]))
    expected = expm(time * generator)
    np.testing.assert_allclose(rotation, expected[:3, :3], atol=1e-12)
    np.testing.assert_allclose(translation, expected[:3, 3], atol=1e-12)


@given(twist=_twists, a=_times, b=_times)
def test_motions_of_consecutive_times_compose(twist, a, b):
    pose = Pose(exp_rotation(np.array([0.3, -0.2, 1.0])), np.array([4.0, 5, 6]))
    twice = carried(carried(pose, twist, a), twist, b)
    assert twice.is_close(carried(pose, twist, a + b), translation=1e-10, rotation=1e-10)


@given(twist=_twists, seconds=st.floats(0.05, 1))
def test_the_twist_between_two_poses_is_recovered(twist, seconds):
    if np.linalg.norm(twist[3:]) * seconds > 3.0:
        return
    before = Pose(exp_rotation(np.array([1.0, 2, 0.5])), np.array([-3.0, 0, 8]))
    after = carried(before, twist, seconds)
    np.testing.assert_allclose(twist_between(before, after, seconds), twist, atol=1e-7)


def test_a_zero_twist_gives_exact_identities():
    rotations, translations = screw(np.zeros(6), np.linspace(-1, 1, 5))
    assert np.array_equal(rotations, np.broadcast_to(np.eye(3), (5, 3, 3)))
    assert np.array_equal(translations, np.zeros((5, 3)))


@pytest.mark.parametrize("rate", [1e-12, 1e-10, 2e-9, 1e-6])
def test_a_slowly_rotating_screw_is_almost_straight(rate):
    _, translations = screw(np.array([1.0, 2, 3, 0, 0, rate]), np.array([0.5]))
    np.testing.assert_allclose(translations, [[0.5, 1.0, 1.5]], atol=2 * rate + 1e-15)
