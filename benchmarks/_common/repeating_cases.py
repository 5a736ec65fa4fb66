"""Cases of worlds that repeat: what has changed, what only looks equal, and distortions.

Same place with 0, 30 and 60 % of the loose things dealt anew, from near and far starts and from a
start at the look-alike pose, one period away. Another floor or hall of equal structure, and another
place of the same kind: every pose is wrong. The cases of `distortions`. Cases of worlds without
loose things begin with "bare".
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._common.contenders import Cloud
from benchmarks._common.distortions import (
    ScanPair,
    distorted_cases,
    max_turn,
    other_sensor,
    rig_cases,
    sensor_at,
    two_sensor_cases,
)
from benchmarks._common.failure_cases import LOCAL, Case, Place, perturbed
from benchmarks._common.repeating_sizes import sizes_of, tolerance_in
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation import Sensor, World, simulate_scan
from scanlock.simulation.scenes.repeating import REPEATING, RepeatingWorld, Visit

_THINGS = (1.0, 1.0, 0.5, 0.0)
"""Factors on the number of loose things, cycled; 0 leaves a bare world."""

_CHANGED = (0.0, 0.3, 0.6)
"""Fractions of the loose things dealt anew between the scans."""

_BASELINES = ((0.3, 1.5), (1.5, 4.0), (4.0, 8.0))
"""Distances between the scans [m], cycled."""

_BASELINE_IN_ROOMS = (0.3, 2.0)
"""Distances in rooms and stairwells [m], where scans overlap no farther apart."""

_OTHER_SEED = 1_000_000
"""Difference of the seeds of two places of the same kind."""


@dataclass(frozen=True, kw_only=True)
class _Site:
    """A world of one seed, a sensor, and two poses."""

    name: str
    seed: int
    sizes: dict[str, Any]
    things: float
    sensor: Sensor
    poses: tuple[Pose, Pose]
    symmetry: Pose | None
    rng: np.random.Generator

    def world(self, **visit: Any) -> World:
        """Return the world of a visit."""
        return REPEATING[self.name](
            Visit(seed=self.seed, **visit), things=self.things, **self.sizes
        ).world

    def scan(self, world: World, sensor: Sensor | None = None) -> Cloud:
        """Return a scan of a world from the second pose."""
        chosen = self.sensor if sensor is None else sensor
        return simulate_scan(world, chosen, self.poses[1], self.rng).points


def repeating_cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Yield the cases of one world per seed; kinds of world, sensors and things cycle."""
    for seed in seeds:
        site = _site(seed)
        rng = site.rng
        first, changed = site.world(), site.world(number=1, changed=_CHANGED[1])
        pair = ScanPair(
            place=Place(f"repeating {site.name} {seed}", site.name, site.sensor.name),
            target=simulate_scan(first, site.sensor, site.poses[0], rng).points,
            source=site.scan(changed),
            truth=site.poses[0].inverse() @ site.poses[1],
            tolerance=tolerance_in(site.name),
            prefix="" if site.things > 0.0 else "bare, ",
        )
        yield from _same_place(site, pair)
        if site.things > 0.0:
            yield from _another_part(site, pair)
        yield from _another_place(site, pair)
        yield from distorted_cases(pair, rng)
        other = other_sensor(site.sensor, seed)
        yield from two_sensor_cases(pair, other, site.scan(changed, other), rng)
        yield from rig_cases(pair, first, site.poses[0], rng)


def _site(seed: int) -> _Site:
    rng = np.random.default_rng([seed, 4])
    turn = seed // len(REPEATING)
    name = tuple(REPEATING)[seed % len(REPEATING)]
    sensor = sensor_at(seed + turn)
    sizes = sizes_of(name, rng)
    is_small = name in ("furnished_room", "stairwell")
    baseline = _BASELINE_IN_ROOMS if is_small else _BASELINES[seed % len(_BASELINES)]
    world = REPEATING[name](Visit(seed=seed), things=0.0, **sizes)
    return _Site(
        name=name,
        seed=seed,
        sizes=sizes,
        things=_THINGS[turn % len(_THINGS)],
        sensor=sensor,
        poses=_poses(world, sensor, baseline, rng),
        symmetry=world.symmetry,
        rng=rng,
    )


def _poses(
    world: RepeatingWorld, sensor: Sensor, baseline: tuple[float, float], rng: np.random.Generator
) -> tuple[Pose, Pose]:
    """Return two poses about a distance apart, as near to it as the places of a world allow."""
    places = world.places
    first = int(rng.integers(len(places)))
    distances = np.linalg.norm(places - places[first], axis=1)
    misfit = np.abs(distances - rng.uniform(*baseline)) + 1e-3 * rng.uniform(size=len(places))
    heading = rng.uniform(-math.pi, math.pi)
    headings = (heading, heading + rng.uniform(-1.0, 1.0) * max_turn(sensor))
    poses = [
        Pose(
            exp_rotation(np.array([0.0, 0.0, yaw])) @ exp_rotation(rng.normal(0.0, 0.02, 3)),
            places[index]
            + [*rng.uniform(-0.2, 0.2, 2), world.sensor_height + rng.uniform(-0.1, 0.1)],
        )
        for index, yaw in zip((first, int(misfit.argmin())), headings, strict=True)
    ]
    return poses[0], poses[1]


def _same_place(site: _Site, pair: ScanPair) -> Iterator[Case]:
    rng, truth = site.rng, pair.truth
    assert truth is not None
    for changed in _CHANGED if site.things > 0.0 else _CHANGED[:1]:
        kind = f"same place, {changed:.0%} changed"
        source = site.scan(site.world(number=1, changed=changed))
        yield pair.case(kind, ("auto",), source=source)
        near = perturbed(truth, 1.5, 8.0, rng)
        yield pair.case(f"{kind}, near start", LOCAL[:2], near, source=source)
        if site.symmetry is not None:
            other = site.poses[0].inverse() @ site.symmetry @ site.poses[1]
            start = perturbed(other, 0.3, 2.0, rng)
            yield pair.case(f"{kind}, look-alike start", LOCAL, start, source=source)
        if changed == _CHANGED[1]:
            far = perturbed(truth, 5.0, 45.0, rng)
            yield pair.case(f"{kind}, far start", LOCAL, far, source=source)


def _another_part(site: _Site, pair: ScanPair) -> Iterator[Case]:
    """Yield cases of another floor, hall or section, without a start and from the equal pose."""
    assert pair.truth is not None
    source = site.scan(site.world(part=1))
    start = perturbed(pair.truth, 0.3, 2.0, site.rng)
    yield pair.case("another part", ("auto",), source=source, truth=None)
    yield pair.case("another part, with start", LOCAL, start, source=source, truth=None)


def _another_place(site: _Site, pair: ScanPair) -> Iterator[Case]:
    """Yield cases of a place of the same kind, with other sizes."""
    kind = "another place of the kind"
    made = REPEATING[site.name](
        Visit(seed=site.seed + _OTHER_SEED), things=site.things, **sizes_of(site.name, site.rng)
    )
    pose = _poses(made, site.sensor, _BASELINES[0], site.rng)[0]
    source = simulate_scan(made.world, site.sensor, pose, site.rng).points
    start = perturbed(Pose.identity(), 3.0, 180.0, site.rng)
    yield pair.case(kind, ("auto",), source=source, truth=None)
    yield pair.case(f"{kind}, with start", LOCAL[:2], start, source=source, truth=None)
