import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.simulation.objects.mover import Mover
from scanlock.simulation.objects.shapes import boxes
from scanlock.simulation.objects.surface_class import SurfaceClass

_BLOCK = boxes([0.0, 0.0, 1.0], [2.0, 1.0, 1.0], SurfaceClass.CAR)
_SQUARE = np.array([[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0], [0, 0, 0]], float)


def test_a_closed_path_is_repeated():
    mover = Mover(surfaces=_BLOCK, path=_SQUARE, start=5.0, speed=2.0)
    for time, position, heading in [(0.0, (5, 0), (1, 0)), (5.0, (10, 5), (0, 1)),
                                 (20.0, (5, 0), (1, 0)), (-5.0, (0, 5), (0, -1))]:  # fmt: skip
        pose, velocity = mover.at(time)
        np.testing.assert_allclose(pose.translation, [*position, 0], atol=1e-12)
        np.testing.assert_allclose(pose.rotation[:, 0], [*heading, 0], atol=1e-12)
        np.testing.assert_allclose(pose.rotation[:, 2], [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(velocity, 2.0 * pose.rotation[:, 0], atol=1e-12)


def test_an_object_stops_at_the_ends_of_an_open_path():
    mover = Mover(surfaces=_BLOCK, path=np.array([[0.0, 0, 0], [0, 8, 6]]), start=0.0, speed=1.0)
    for time, position, speed in [(-3.0, (0, 0, 0), 0.0), (5.0, (0, 4, 3), 1.0),
                               (12.0, (0, 8, 6), 0.0)]:  # fmt: skip
        pose, velocity = mover.at(time)
        np.testing.assert_allclose(pose.translation, position, atol=1e-12)
        np.testing.assert_allclose(velocity, speed * np.array([0, 0.8, 0.6]), atol=1e-12)
    # Uphill the object pitches, and its y axis stays horizontal.
    np.testing.assert_allclose(pose.rotation[:, 1], [-1, 0, 0], atol=1e-12)


def test_the_radius_includes_the_farthest_corner():
    mover = Mover(surfaces=_BLOCK, path=_SQUARE, start=0.0, speed=0.0)
    assert mover.radius == pytest.approx(np.sqrt(2.0**2 + 1.0**2 + 2.0**2), abs=1e-4)


@pytest.mark.parametrize(
    ("path", "speed", "message"),
    [
        (_SQUARE[:1], 1.0, "path must have shape"),
        (_SQUARE[:, :2], 1.0, "path must have shape"),
        (_SQUARE[[0, 0, 1]], 1.0, "consecutive corners must differ"),
        (_SQUARE * np.nan, 1.0, "path must be finite"),
        (_SQUARE, -1.0, "speed must be at least 0.0 m/s, got -1.0 m/s"),
    ],
)
def test_invalid_paths_and_speeds_are_refused(path, speed, message):
    with pytest.raises(InvalidInput, match=message):
        Mover(surfaces=_BLOCK, path=path, start=0.0, speed=speed)
