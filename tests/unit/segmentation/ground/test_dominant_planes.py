import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.segmentation.ground.dominant_planes import SurfaceSample

_HALF_SIDES = np.array([8.0, 5.0, 1.5])
"""Half the sides of a room [m]; the sensor is 0.5 m below its middle."""


def _room(rng, count=4000):
    """Points on the floor and the four walls of a room, and the number on the floor."""
    points = rng.uniform(-1.0, 1.0, (count, 3))
    face = rng.integers(0, 5, count)
    axis, side = np.array([2, 0, 0, 1, 1])[face], np.array([-1.0, -1.0, 1.0, -1.0, 1.0])[face]
    points[np.arange(count), axis] = side
    return points * _HALF_SIDES + np.array([0.0, 0.0, 0.5])


def test_the_planes_of_a_room_face_inwards_and_the_largest_near_one_is_first():
    planes = SurfaceSample.of(_room(np.random.default_rng(0))).dominant_planes()
    assert np.allclose(planes[0].normal, [0.0, 0.0, 1.0], atol=0.02)
    assert planes[0].offset == pytest.approx(1.0, abs=0.05)
    assert sorted(one.score for one in planes) == [one.score for one in planes][::-1]
    for normal in ([1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0], [0, -1.0, 0]):
        assert max(one.normal @ np.array(normal) for one in planes) > 0.999


@pytest.mark.parametrize("seed", range(4))
def test_dominant_planes_turn_with_the_points(seed):
    rng = np.random.default_rng(seed)
    points, turn = _room(rng), Rotation.random(rng=rng).as_matrix()
    best = SurfaceSample.of(points @ turn.T).dominant_planes()[0]
    assert np.allclose(best.normal, turn[:, 2], atol=0.02)
    again = SurfaceSample.of(points @ turn.T).dominant_planes()[0]
    assert (best.normal == again.normal).all()
    sample = SurfaceSample.of(points @ turn.T)
    assert sample.score(best.normal, best.offset) == pytest.approx(best.score, abs=1e-6)
    assert sample.score(-best.normal, -best.offset) < best.score


@pytest.mark.parametrize(
    "points",
    [np.zeros((1, 3)), np.ones((50, 3)), np.outer(np.linspace(1.0, 30.0, 60), [1.0, 0.3, 0.1])],
    ids=["one point", "one voxel", "a line"],
)
def test_points_without_a_plane_have_no_upright_side(points):
    for plane in SurfaceSample.of(points).dominant_planes():
        assert np.linalg.norm(plane.normal) == pytest.approx(1.0)
