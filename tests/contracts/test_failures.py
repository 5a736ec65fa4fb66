"""Results of every method for scans without a correct pose."""

import json
import math

import numpy as np
import pytest

from contracts.traits import METRES, TRAITS, max_point_distance, motion, source, target
from reference.pairs import register_pair
from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("method", METHODS)]


def _blobs(centres):
    rng = np.random.default_rng(0)
    return np.concatenate([c + rng.normal(0.0, 0.05, (30, 3)) for c in np.array(centres)])


def _different_blobs():
    """Three blobs per scan that overlap only when smoothed."""
    target = [[-5.0, -10.0, 0.0], [9.0, -8.0, -1.0], [-3.0, -9.0, -1.0]]
    source = [[2.0, -6.0, 1.0], [-9.0, 13.0, 0.0], [-12.0, 4.0, 1.0]]
    return _blobs(source), _blobs(target)


def _ground(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-30, 30, (5000, 2)), rng.normal(-1.7, 0.02, 5000)])


_FEATURELESS = {
    "one point": np.ones((1, 3)),
    "two points": np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]),
    "equal points": np.full((500, 3), 2.5),
    "bare ground": _ground(0),
}

_NOISE = np.random.default_rng(1).uniform(-20.0, 20.0, (3000, 3))


def _corridor(seed, count=6000):
    """Points of an endless corridor."""
    rng = np.random.default_rng(seed)
    along = rng.uniform(-40.0, 40.0, count)
    side = rng.choice([-2.0, 2.0], count)
    across, height = side.copy(), rng.uniform(0.0, 3.0, count)
    is_ground = rng.random(count) < 1 / 3
    across[is_ground], height[is_ground] = rng.uniform(-2.0, 2.0, is_ground.sum()), 0.0
    points = np.column_stack([along, across, height - 1.5])
    return points + rng.normal(0.0, 0.02, points.shape)


def _line(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-10.0, 10.0, 2000), np.full((2000, 2), [5.0, 1.0])])


def _wall(seed):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [rng.uniform(-10.0, 10.0, 3000), np.full(3000, 8.0), rng.uniform(-1.0, 3.0, 3000)]
    )


def test_scans_without_overlap_return_the_initial_pose(method):
    initial = yaw_pose(0.3, (500.0, 20.0, 0.0))
    found = register(source=source(method), target=target(), method=method, initial=initial)
    if TRAITS[method].searches:
        # A global search recovers from a wrong initial pose.
        assert found.status is Status.OK
        assert (
            max_point_distance(found.target_from_source, motion(method), source(method))
            < 2 * METRES
        )
        return
    assert found.status is not Status.OK
    if TRAITS[method].is_bounded:
        assert found.status is Status.NO_CORRESPONDENCES
        assert found.target_from_source == initial
        assert found.overlap == 0.0


def test_no_correspondences_means_the_initial_pose(method):
    found = register_pair(_different_blobs(), method=method)
    assert not found.ok
    is_empty = found.status is Status.NO_CORRESPONDENCES
    assert (found.target_from_source == Pose.identity()) == is_empty


def test_a_scan_of_noise_is_never_ok(method):
    initial = yaw_pose(0.3, (1.0, 2.0, 0.0))
    for source_points, target_points in ((_NOISE, target()), (source(method), _NOISE)):
        found = register(source=source_points, target=target_points, method=method, initial=initial)
        assert found.status is not Status.OK
        assert found.probability < 0.5
        assert found.length_scale > 1.0


@pytest.mark.parametrize("scan", _FEATURELESS)
def test_scans_without_features_return_the_initial_pose(method, scan):
    initial = yaw_pose(0.3, (1.0, 2.0, 0.0))
    featureless = _FEATURELESS[scan]
    if scan == "bare ground" and TRAITS[method].uses_ground:
        # Bare ground constrains height, roll and pitch only.
        both = register(source=featureless, target=_ground(1), method=method, initial=initial)
        assert both.status is not Status.OK
        return
    for source_points, target_points, role in (
        (featureless, target(), "source"),
        (source(method), featureless, "target"),
        (featureless, featureless, "target"),
    ):
        found = register(source=source_points, target=target_points, method=method, initial=initial)
        assert found.status is Status.NO_CORRESPONDENCES
        assert role in found.reason
        assert found.target_from_source == initial
        assert math.isnan(found.overlap)
        assert math.isnan(found.score)
        assert found.as_dict()["metrics"]["score"] is None
        assert found.history == ()


@pytest.mark.parametrize("layout", range(4))
def test_scans_of_different_places_are_not_trusted(method, layout):
    other = street(2, 4000, layout=100 + layout)
    found = register(source=other, target=target(), method=method)
    assert found.status is not Status.OK
    assert found.status is not Status.DEGENERATE
    assert np.isfinite(found.target_from_source.matrix).all()


@pytest.mark.parametrize("scene", [_corridor, _line, _wall], ids=["corridor", "line", "wall"])
def test_scenes_invariant_to_a_translation_are_not_trusted(method, scene):
    # The scans are equal from every position along the scene, so no pose along it is correct.
    assert register(source=scene(1), target=scene(2), method=method).status is not Status.OK


@pytest.mark.parametrize("name", ["corridor", "wall"])
def test_the_unconstrained_translation_is_degenerate_and_named(method, name):
    scene = {"corridor": _corridor, "wall": _wall}[name]
    rotated = yaw_pose(0.5, (0.0, 0.0, 0.0)).apply(scene(1))
    found = register(source=rotated, target=rotated, method=method)
    assert found.status is Status.DEGENERATE
    degenerate = [one for one in found.degenerate_directions if one.kind == "translation"]
    assert str(degenerate[0]) in found.reason
    # A wall is invariant to two translations; the ground of a corridor constrains one of them.
    for x, y, z in (one.axis for one in degenerate):
        assert abs(y * np.cos(0.5) - x * np.sin(0.5)) < 0.1
        assert name == "wall" or abs(z) < 0.1


def test_poses_are_finite_for_every_status(method):
    scans = [*_FEATURELESS.values(), _line(1), _wall(1), *_different_blobs(), target()]
    for scan in scans:
        found = register(source=scan, target=_different_blobs()[1], method=method)
        assert np.isfinite(found.target_from_source.matrix).all()
        assert json.loads(found.to_json())["status"] == found.status.value
