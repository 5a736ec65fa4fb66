"""Cases of more sensors and of distorted scans, in simulated scenes and of real pairs."""

import zlib
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks._common.distortions import (
    ScanPair,
    distorted_cases,
    max_turn,
    other_sensor,
    rig_cases,
    sensor_at,
    two_sensor_cases,
)
from benchmarks._common.failure_cases import (
    LOCAL,
    Case,
    Place,
    perturbed,
    scene_of,
    sensor_of,
    world_of,
)
from benchmarks._common.real_scans import RealPair
from benchmarks._common.turned_pairs import headings, tolerance_of
from scanlock.simulation import SCENES, simulate_scan

_MAX_PAIRS = 3
"""Maximum number of pairs per group of real pairs, evenly spaced."""

_BASELINES = ((0.3, 2.0), (2.0, 6.0), (6.0, 15.0))
"""Distances between the scans of simulated pairs [m], cycled by seed."""


def scene_cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Yield cases of one street, forest or rugged scene per seed; all sensors cycle."""
    for seed in seeds:
        rng = np.random.default_rng([seed, 5])
        kind = tuple(SCENES)[seed % len(SCENES)]
        sensor = sensor_at(seed // len(SCENES))
        scene = SCENES[kind](rng)
        along = rng.uniform(0.0, scene.track.length)
        beyond = along + rng.uniform(*_BASELINES[seed % len(_BASELINES)])
        yaw = float((scene.track.heading(along) - scene.track.heading(beyond))[0])
        yaw += rng.uniform(-1.0, 1.0) * max_turn(sensor)
        poses = (scene.sensor_pose(along), scene.sensor_pose(beyond, rng.uniform(-0.3, 0.3), yaw))
        # Traffic moves with the speed of the carrier, so that no pose is inside a moving car.
        times = [length / scene.carrier.speed for length in (along, beyond)]
        target, source = (
            simulate_scan(scene.world, sensor, pose, rng, time=time).points
            for pose, time in zip(poses, times, strict=True)
        )
        truth = poses[0].inverse() @ poses[1]
        pair = ScanPair(
            place=Place(f"simulated {kind} {seed}", kind, sensor.name),
            target=target,
            source=source,
            truth=truth,
        )
        yield pair.case("same place", ("auto",))
        near = perturbed(truth, 1.5, 8.0, rng)
        yield pair.case("same place, near start", LOCAL[:2], near)
        yield from distorted_cases(pair, rng)
        other = other_sensor(sensor, seed)
        source = simulate_scan(scene.world, other, poses[1], rng, time=times[1]).points
        yield from two_sensor_cases(pair, other, source, rng)
        yield from rig_cases(pair, scene.world, poses[0], rng, time=times[0])


def real_distorted_cases(pairs: Sequence[RealPair]) -> Iterator[Case]:
    """Yield cases of a few real pairs of one group, with a wrong scale or mirrored."""
    group = pairs[0].group
    rng = np.random.default_rng([zlib.crc32(group.encode()), 6])
    for index in np.unique(np.linspace(0, len(pairs) - 1, _MAX_PAIRS).round().astype(int)):
        pair = pairs[int(index)]
        turn = headings(group, int(index), 1)[0]
        scans = ScanPair(
            place=Place(scene_of(group), world_of(group), sensor_of(group)),
            target=pair.load_target(),
            source=turn.apply(pair.load_source()),
            truth=pair.truth @ turn.inverse(),
            tolerance=tolerance_of(group),
        )
        yield from distorted_cases(scans, rng)
