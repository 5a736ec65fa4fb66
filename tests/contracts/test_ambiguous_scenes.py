"""Degenerate and ambiguous scenes: no method gives a wrong pose the status ok."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status
from scanlock.simulation import hdl_32e, simulate_scan
from scanlock.simulation.scenes.look_alikes import (
    corridor,
    crossing,
    open_field,
    shaft,
    terrace,
    tunnel,
)

_WORLDS = {
    "field": (open_field, 1.5),
    "corridor": (corridor, 1.2),
    "tunnel": (tunnel, 0.0),
    "shaft": (shaft, 1.5),
    "crossing": (crossing, 1.5),
    "terrace": (terrace, 1.5),
}

_UNCONSTRAINED = {
    "field": {("translation", 0), ("translation", 1), ("rotation", 2)},
    "corridor": {("translation", 0)},
    "tunnel": {("translation", 0), ("rotation", 0)},
    "shaft": {("rotation", 2)},
}
"""Unconstrained directions, by kind and axis of the world."""

_YAW = 0.3
"""Yaw of the target in the world [rad]."""


@cache
def _scans(name):
    make, height = _WORLDS[name]
    world, sensor = make(), replace(hdl_32e(), azimuth_steps=720)
    rng = np.random.default_rng(5)
    poses = yaw_pose(_YAW, (0.2, 0.1, height)), yaw_pose(_YAW + 0.1, (0.9, -0.2, height))
    target, source = (simulate_scan(world, sensor, pose, rng).points for pose in poses)
    return target, source, poses[0].inverse() @ poses[1]


@pytest.fixture(params=METHODS)
def method(request):
    return request.param


@pytest.mark.slow
@pytest.mark.parametrize("name", _WORLDS)
def test_a_pose_with_status_ok_is_correct(method, name):
    target, source, truth = _scans(name)
    starts = [None, truth]
    if name not in ("crossing", "terrace") or METHODS[method] == METHODS["auto"]:
        # A local method cannot distinguish the true pose from an equivalent one near its start.
        starts.append(yaw_pose(math.pi / 2, (4.0, 0.0, 0.0)) @ truth)
    for initial in starts:
        found = register(source=source, target=target, method=method, initial=initial)
        metres, radians = found.target_from_source.distance(truth)
        assert not found.ok or (metres < 0.3 and radians < math.radians(1.0))


@pytest.mark.slow
@pytest.mark.parametrize("name", _UNCONSTRAINED)
def test_unconstrained_directions_are_degenerate_and_named(name):
    target, source, truth = _scans(name)
    found = register(source=source, target=target, method="gicp", initial=truth)
    assert found.status is Status.DEGENERATE
    world_from_target = yaw_pose(_YAW, (0.0, 0.0, 0.0)).rotation
    axes = {
        (one.kind, int(np.argmax(np.abs(world_from_target @ one.axis))))
        for one in found.degenerate_directions
    }
    assert axes == _UNCONSTRAINED[name]
    assert all(one.name in found.reason for one in found.degenerate_directions)


def test_fix_degenerate_keeps_the_initial_pose_along_degenerate_directions():
    target, source, truth = _scans("corridor")
    corridor_axis = yaw_pose(-_YAW, (0.0, 0.0, 0.0)).rotation @ np.array([1.0, 0.0, 0.0])
    initial = yaw_pose(0.0, tuple(2.0 * corridor_axis)) @ truth
    unfixed = register(source=source, target=target, method="gicp", initial=initial)
    fixed = register(
        source=source, target=target, method="gicp", initial=initial, fix_degenerate=True
    )
    (degenerate,) = unfixed.degenerate_directions
    step = fixed.target_from_source.translation - initial.translation
    assert abs(degenerate.axis @ step) < 1e-6
    change = fixed.target_from_source.translation - unfixed.target_from_source.translation
    assert np.linalg.norm(change - degenerate.axis * (degenerate.axis @ change)) < 0.02
    assert fixed.status is Status.DEGENERATE
    assert any("fixed at the initial pose" in note for note in fixed.notes)
