import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.simulation.terrain.track import Track


def _circle(radius=20.0):
    angles = np.arange(8) * np.pi / 4
    return Track.round(radius * np.column_stack([np.cos(angles), np.sin(angles)]), bend=12.0)


def test_a_round_track_is_smooth_and_closed():
    track = _circle()
    along = np.linspace(0, track.length, 400)
    positions = track.at(along)
    np.testing.assert_allclose(positions[0], positions[-1], atol=1e-9)
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    np.testing.assert_allclose(steps, track.length / 399, rtol=0.01)
    assert np.abs(np.diff(track.heading(along))).max() < 0.1
    # The heading grows by a full turn per lap, beyond the first lap too.
    assert track.heading(track.length * 2.5)[0] - track.heading(track.length * 0.5)[
        0
    ] == pytest.approx(4 * np.pi)


def test_positive_offsets_are_to_the_left_of_the_heading():
    track = Track.straight([1.0, 2.0], [1.0, 12.0])
    assert track.length == pytest.approx(10.0)
    np.testing.assert_allclose(track.at([3.0], 2.0), [[-1.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(track.heading([0.0, 5.0]), np.pi / 2)
    np.testing.assert_allclose(track.beside(-1.0).at([3.0]), [[2.0, 5.0]], atol=1e-9)
    np.testing.assert_allclose(track.reversed().at([3.0], 1.0), [[2.0, 9.0]], atol=1e-9)


def test_a_parallel_track_has_a_constant_distance():
    track = _circle()
    beside = track.beside(3.0)
    assert beside.is_closed
    along = np.linspace(0, track.length, 100)
    distances = np.linalg.norm(track.at(along)[:, None] - beside.points, axis=2).min(axis=1)
    np.testing.assert_allclose(distances, 3.0, atol=0.02)
    assert beside.length == pytest.approx(track.length - 6 * np.pi, rel=0.01)


def test_tracks_of_fewer_than_three_points_are_refused():
    with pytest.raises(InvalidInput, match="k > 2"):
        Track(np.zeros((2, 2)), False)
