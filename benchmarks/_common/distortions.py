"""Cases of one pair of scans with a wrong scale, mirrored, across sensors, or of a rig.

A pose between scans of different scales has no correct value, unless the scale displaces the points
of the source by less than the tolerance (root mean square, about its sensor); then the true pose is
correct as usual. No pose of a mirrored scan is correct.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks._common.contenders import MAX_DEGREES, MAX_METRES, Cloud
from benchmarks._common.failure_cases import LOCAL, Case, Place, pair_name, perturbed
from scanlock.geometry.pose import Pose
from scanlock.simulation import SENSORS, Rig, Sensor, World, simulate_rig

_SCALE_ERRORS = (0.01, 0.05)
"""Smallest and largest error of the scale, in both directions."""


@dataclass(frozen=True, kw_only=True)
class ScanPair:
    """Two scans of one place, and the columns that their cases share."""

    place: Place
    target: Cloud
    source: Cloud
    truth: Pose | None
    tolerance: tuple[float, float] = (MAX_METRES, MAX_DEGREES)
    prefix: str = ""
    """Begin of the kind of every case."""

    def case(
        self, kind: str, methods: Sequence[str], start: Pose | None = None, **changes: Any
    ) -> Case:
        """Return a case of these scans; `changes` replace columns and scans."""
        columns = {
            **vars(self.place), "target": self.target, "source": self.source, "truth": self.truth,
            "tolerance": self.tolerance,
        }  # fmt: skip
        return Case(
            kind=self.prefix + kind, methods=tuple(methods), start=start, **(columns | changes)
        )


def distorted_cases(pair: ScanPair, rng: np.random.Generator) -> Iterator[Case]:
    """Yield cases of a source with a wrong scale, and of a mirrored one, from starts near by."""
    assert pair.truth is not None
    error = float(rng.choice([-1.0, 1.0])) * rng.uniform(*_SCALE_ERRORS)
    displacement = abs(error) * math.sqrt(float((pair.source**2).sum(axis=1).mean()))
    correct = pair.truth if displacement < pair.tolerance[0] else None
    start = perturbed(pair.truth, 0.5, 3.0, rng)
    for kind, source, truth in (
        ("wrong scale", (1.0 + error) * pair.source, correct),
        ("mirrored", pair.source * [1.0, -1.0, 1.0], None),
    ):
        yield pair.case(kind, ("auto",), source=source, truth=truth)
        yield pair.case(f"{kind}, with start", LOCAL[:2], start, source=source, truth=truth)


def two_sensor_cases(
    pair: ScanPair, other: Sensor, source: Cloud, rng: np.random.Generator
) -> Iterator[Case]:
    """Yield cases of the target and a source of another sensor at the same pose."""
    assert pair.truth is not None
    sensor = pair_name(pair.place.sensor, other.name)
    start = perturbed(pair.truth, 1.5, 8.0, rng)
    yield pair.case("two sensors", ("auto",), source=source, sensor=sensor)
    yield pair.case("two sensors, near start", LOCAL[:2], start, source=source, sensor=sensor)


def rig_cases(
    pair: ScanPair, world: World, pose: Pose, rng: np.random.Generator, *, time: float = 0.0
) -> Iterator[Case]:
    """Yield cases of two sensors of one rig that look apart; the true pose is their extrinsic."""
    sensor = SENSORS[pair.place.sensor]()
    if is_narrow(sensor):
        rig = Rig.looking_apart(sensor, rng.uniform(0.3, 0.7) * sensor.width)
    else:
        rig = Rig.tilted_apart(sensor, math.radians(rng.uniform(10.0, 40.0)))
    first, second = simulate_rig(world, rig, pose, rng, time=time)
    truth = first.pose.inverse() @ second.pose
    scans = {"target": first.points, "source": second.points, "truth": truth}
    yield pair.case("rig", ("auto",), **scans)
    yield pair.case("rig, near start", LOCAL[:2], perturbed(truth, 0.5, 8.0, rng), **scans)


def is_narrow(sensor: Sensor) -> bool:
    """Return whether a sensor does not see all around."""
    return sensor.width < 2.0 * math.pi - 1e-9


def max_turn(sensor: Sensor) -> float:
    """Return the largest difference of headings at which the views overlap well [rad]."""
    return 0.3 * sensor.width if is_narrow(sensor) else math.pi


def sensor_at(index: int) -> Sensor:
    """Return the sensor of an index; they cycle."""
    return tuple(SENSORS.values())[index % len(SENSORS)]()


def other_sensor(sensor: Sensor, seed: int) -> Sensor:
    """Return a sensor of another kind."""
    offset = 1 + seed // 3 % (len(SENSORS) - 1)
    return sensor_at(tuple(SENSORS).index(sensor.name) + offset)
