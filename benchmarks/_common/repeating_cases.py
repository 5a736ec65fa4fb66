"""Cases of worlds that repeat: what has changed, what only looks equal, and other distortions.

Same place with 0, 30 and 60 % of the loose things dealt anew, from near starts and from a start at
the look-alike pose one period away. Another floor or hall of equal structure, another place of the
same kind, mirrored scans: every pose is wrong. A wrong scale: every pose is wrong where the scale
displaces the points by more than the tolerance. Two sensors in one place, and two sensors of one
rig that look apart.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._common.contenders import MAX_DEGREES, MAX_METRES, Cloud
from benchmarks._common.failure_cases import LOCAL, Case, pair_name, perturbed
from benchmarks._common.repeating_sizes import sizes_of, tolerance_in
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation import SENSORS, Rig, Sensor, World, simulate_rig, simulate_scan
from scanlock.simulation.scenes.repeating import REPEATING, RepeatingWorld, Visit

_THINGS = (1.0, 1.0, 0.5, 0.0)
"""Factors on the number of loose things, cycled; 0 leaves a bare world."""

_CHANGED = (0.0, 0.3, 0.6)
"""Fractions of the loose things dealt anew between the scans."""

_BASELINES = ((0.3, 1.5), (1.5, 4.0), (4.0, 8.0))
"""Distances between the scans [m], cycled."""

_OTHER_SEED = 1_000_000
"""Difference of the seeds of two places of the same kind."""


@dataclass(frozen=True, kw_only=True)
class _Site:
    """A world of one seed, and two poses in it."""

    name: str
    seed: int
    sizes: dict[str, Any]
    things: float
    sensor: Sensor
    poses: tuple[Pose, Pose]
    symmetry: Pose | None
    rng: np.random.Generator

    @property
    def truth(self) -> Pose:
        return self.poses[0].inverse() @ self.poses[1]

    def world(self, **visit: Any) -> World:
        """Return the world of a visit."""
        made = REPEATING[self.name](
            Visit(**({"seed": self.seed} | visit)), things=self.things, **self.sizes
        )
        return made.world

    def scan(self, world: World, index: int, sensor: Sensor | None = None) -> Cloud:
        """Return a scan of a world from one of the two poses."""
        sensor = self.sensor if sensor is None else sensor
        return simulate_scan(world, sensor, self.poses[index], self.rng).points

    def case(
        self, kind: str, methods: Sequence[str], target: Cloud, source: Cloud, truth: Pose | None,
        start: Pose | None = None, sensor: str | None = None,
    ) -> Case:  # fmt: skip
        """Return a case of this site."""
        return Case(
            scene=f"repeating {self.name} {self.seed}",
            kind=kind if self.things > 0.0 else f"bare, {kind}",
            world=self.name,
            sensor=self.sensor.name if sensor is None else sensor,
            target=target,
            source=source,
            truth=truth,
            start=start,
            methods=tuple(methods),
            tolerance=tolerance_in(self.name, (MAX_METRES, MAX_DEGREES)),
        )


def repeating_cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Yield the cases of one world per seed; kinds of world, sensors and things cycle."""
    for seed in seeds:
        site = _site(seed)
        target = site.scan(site.world(), 0)
        yield from _same_place(site, target)
        if site.things > 0.0:
            yield from _another_part(site, target)
        yield from _another_place(site, target)
        yield from _distorted(site, target)
        yield from _two_sensors(site, target)
        yield from _rig(site)


def _site(seed: int) -> _Site:
    rng = np.random.default_rng([seed, 4])
    turn = seed // len(REPEATING)
    name = tuple(REPEATING)[seed % len(REPEATING)]
    sensor = tuple(SENSORS.values())[(seed + turn) % len(SENSORS)]()
    sizes = sizes_of(name, rng)
    world = REPEATING[name](Visit(seed=seed), things=0.0, **sizes)
    return _Site(
        name=name,
        seed=seed,
        sizes=sizes,
        things=_THINGS[turn % len(_THINGS)],
        sensor=sensor,
        poses=_poses(world, sensor, _BASELINES[seed % len(_BASELINES)], rng),
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
    second = int(misfit.argmin())
    heading = rng.uniform(-math.pi, math.pi)
    # The views of sensors that do not see all around must overlap.
    most = math.pi if sensor.width > 6.0 else 0.3 * sensor.width
    headings = (heading, heading + rng.uniform(-most, most))
    poses = [
        Pose(
            exp_rotation(np.array([0.0, 0.0, yaw])) @ exp_rotation(rng.normal(0.0, 0.02, 3)),
            places[index]
            + [*rng.uniform(-0.2, 0.2, 2), world.sensor_height + rng.uniform(-0.1, 0.1)],
        )
        for index, yaw in zip((first, second), headings, strict=True)
    ]
    return poses[0], poses[1]


def _same_place(site: _Site, target: Cloud) -> Iterator[Case]:
    truth, rng = site.truth, site.rng
    for changed in _CHANGED if site.things > 0.0 else _CHANGED[:1]:
        kind = f"same place, {changed:.0%} changed"
        source = site.scan(site.world(number=1, changed=changed), 1)
        yield site.case(kind, ("auto",), target, source, truth)
        near = perturbed(truth, 1.5, 8.0, rng)
        yield site.case(f"{kind}, near start", LOCAL[:2], target, source, truth, near)
        if site.symmetry is not None:
            other = site.poses[0].inverse() @ site.symmetry @ site.poses[1]
            start = perturbed(other, 0.3, 2.0, rng)
            yield site.case(f"{kind}, look-alike start", LOCAL, target, source, truth, start)
        if changed == _CHANGED[1]:
            far = perturbed(truth, 5.0, 45.0, rng)
            yield site.case(f"{kind}, far start", LOCAL, target, source, truth, far)


def _another_part(site: _Site, target: Cloud) -> Iterator[Case]:
    """Yield cases of another floor, hall or section, from the pose that looks equal."""
    source = site.scan(site.world(part=1), 1)
    yield site.case("another part", ("auto",), target, source, None)
    start = perturbed(site.truth, 0.3, 2.0, site.rng)
    yield site.case("another part, with start", LOCAL, target, source, None, start)


def _another_place(site: _Site, target: Cloud) -> Iterator[Case]:
    """Yield cases of a place of the same kind, with other sizes."""
    made = REPEATING[site.name](
        Visit(seed=site.seed + _OTHER_SEED), things=site.things, **sizes_of(site.name, site.rng)
    )
    poses = _poses(made, site.sensor, _BASELINES[0], site.rng)
    source = simulate_scan(made.world, site.sensor, poses[0], site.rng).points
    yield site.case("another place of the kind", ("auto",), target, source, None)
    start = perturbed(Pose.identity(), 3.0, 180.0, site.rng)
    yield site.case("another place of the kind, with start", LOCAL[:2], target, source, None, start)


def _distorted(site: _Site, target: Cloud) -> Iterator[Case]:
    """Yield cases of a source with a wrong scale, and of a mirrored one.

    A pose between scans of different scales has no correct value, unless the scale displaces the
    points of the source by less than the tolerance (root mean square, about its sensor).
    """
    rng, truth = site.rng, site.truth
    source = site.scan(site.world(number=1, changed=_CHANGED[1]), 1)
    error = float(rng.choice([-1.0, 1.0])) * rng.uniform(0.01, 0.05)
    displacement = abs(error) * math.sqrt(float((source**2).sum(axis=1).mean()))
    start = perturbed(truth, 0.5, 3.0, rng)
    tolerance = tolerance_in(site.name, (MAX_METRES, MAX_DEGREES))[0]
    correct = truth if displacement < tolerance else None
    scaled = (1.0 + error) * source
    yield site.case("wrong scale", ("auto",), target, scaled, correct)
    yield site.case("wrong scale, with start", LOCAL[:2], target, scaled, correct, start)
    mirrored = source * [1.0, -1.0, 1.0]
    yield site.case("mirrored", ("auto",), target, mirrored, None)
    yield site.case("mirrored, with start", LOCAL[:2], target, mirrored, None, start)


def _two_sensors(site: _Site, target: Cloud) -> Iterator[Case]:
    """Yield cases of two different sensors in one place."""
    names = tuple(SENSORS)
    offset = 1 + site.seed // 3 % (len(names) - 1)
    other = SENSORS[names[(names.index(site.sensor.name) + offset) % len(names)]]()
    source = site.scan(site.world(number=1, changed=_CHANGED[1]), 1, other)
    both = pair_name(site.sensor.name, other.name)
    start = perturbed(site.truth, 1.5, 8.0, site.rng)
    yield site.case("two sensors", ("auto",), target, source, site.truth, sensor=both)
    yield site.case(
        "two sensors, near start", LOCAL[:2], target, source, site.truth, start, both
    )  # fmt: skip


def _rig(site: _Site) -> Iterator[Case]:
    """Yield cases of two sensors of one rig that look apart."""
    sensor, rng = site.sensor, site.rng
    if sensor.width < 6.0:
        rig = Rig.looking_apart(sensor, rng.uniform(0.3, 0.7) * sensor.width)
    else:
        rig = Rig.tilted_apart(sensor, math.radians(rng.uniform(10.0, 40.0)))
    first, second = simulate_rig(site.world(), rig, site.poses[0], rng)
    truth = first.pose.inverse() @ second.pose
    start = perturbed(truth, 0.5, 8.0, rng)
    yield site.case("rig", ("auto",), first.points, second.points, truth)
    yield site.case("rig, near start", LOCAL[:2], first.points, second.points, truth, start)
