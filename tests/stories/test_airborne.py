"""Halves of airborne tiles: moved, turned, and found again to a tenth of their spacing."""

import math

import numpy as np
import pytest
from scipy.spatial import cKDTree

import scanlock
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

pytestmark = [pytest.mark.slow, pytest.mark.data]

_TILES = ("formats/las/Topography.laz", "formats/las/autzen_trim.laz")


def _halves(points, seed):
    """Target, source and true pose about the middle of a tile, and the spacing of the target."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(points))
    points = points - np.round(np.median(points, axis=0))
    turn = exp_rotation(np.array([0.0, 0.0, math.radians(1.5)]))
    truth = Pose(turn, np.array([2.0, -1.1, 0.2]))
    target, source = points[order[::2]], points[order[1::2]]
    distances, _ = cKDTree(target).query(target[::20], k=2)
    return target, truth.inverse().apply(source), truth, float(np.median(distances[:, 1]))


def _error(pose, truth, points):
    return float(np.sqrt(((pose.apply(points) - truth.apply(points)) ** 2).sum(axis=1).mean()))


@pytest.mark.parametrize("file", _TILES)
def test_halves_of_a_tile_are_solved_and_ok(scan_data, file):
    target, source, truth, spacing = _halves(scanlock.read_scan(scan_data / file).points, 0)
    result = scanlock.register(source=source, target=target)
    assert result.length_scale > 1.0
    assert _error(result.target_from_source, truth, source) < 0.1 * spacing
    assert result.ok
    for method in ("gicp", "ndt-d2d"):
        local = scanlock.register(source=source, target=target, method=method)
        assert local.status is not scanlock.Status.NO_CORRESPONDENCES
        assert _error(local.target_from_source, truth, source) < 0.5 * spacing


@pytest.mark.parametrize("file", _TILES)
def test_wrong_poses_of_a_tile_are_not_ok(scan_data, file):
    target, source, truth, spacing = _halves(scanlock.read_scan(scan_data / file).points, 1)
    for step in (
        (3.0 * spacing, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 3.0 * spacing, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, math.radians(5.0)),
        (0.0, 0.0, 0.0, 0.0, 0.0, math.pi),
    ):
        wrong = Pose.from_step(np.array(step)) @ truth
        assert not scanlock.assess(source=source, target=target, pose=wrong).ok


def test_another_tile_is_not_ok(scan_data):
    first, second = (scanlock.read_scan(scan_data / file).points for file in _TILES)
    source, target = (one - np.median(one, axis=0) for one in (first, second))
    for method in ("auto", "gicp"):
        assert not scanlock.register(source=source, target=target, method=method).ok
