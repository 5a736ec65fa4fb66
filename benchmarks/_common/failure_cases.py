"""Pairs with known truth for the evaluation of failure detection, most of them difficult.

Real pairs with any heading, from starts up to 8 m and 45 degrees off, and cropped to sectors. Real
scans of different places. Simulated pairs of streets, forests and rugged ground, of different
places, and of worlds with repeated structure. Noise.
"""

import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks._common.contenders import MAX_DEGREES, MAX_METRES, Cloud
from benchmarks._common.real_scans import RealPair
from benchmarks._common.turned_pairs import all_pairs, headings, tolerance_of
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.simulation import SENSORS, scan_pair, simulate_scan
from scanlock.simulation.scenes.look_alikes import (
    corridor,
    crossing,
    open_field,
    shaft,
    terrace,
    tunnel,
)
from scanlock.simulation.world import World

LOCAL = ("sgc-ndt-d2d", "gicp", "vgicp", "ndt", "icp")
"""Local methods, which end at a wrong pose from a start outside their basin."""

_SIMULATED_SENSORS = ("hdl_64e", "hdl_32e", "os1_64")
"""Sensors of simulated pairs, cycled by seed."""

_REAL_SENSORS = {
    "kitti": "hdl_64e",
    "newer_01": "os1_64",
    "forest": "os1_64",
    "handheld": "handheld 64",
    "hdl32": "hdl_32e",
    "av2_pair": "vlp_32c",
    "car_cloud": "car_cloud",
    "rellis": "os1_64 and velodyne",
    "terrestrial": "terrestrial",
}
"""Kinds of the real sensors, by the first letters of the group's name."""

_KINDS = {"tunnel": "ringed_tunnel", "crossing": "crossroads", "terrace": "terraced_street"}
"""Worlds that repeat of the same kind as a world without a single correct pose."""

_SECTORS = (120.0, 180.0, 240.0)
"""Angles of the sectors that scans are cropped to [deg]."""

_STRIDE = 10
"""A downsampled scan consists of every tenth point."""

_BASELINES = ((0.5, 3.0), (3.0, 8.0), (8.0, 15.0), (15.0, 25.0))
"""Distances between the scans of simulated pairs [m], cycled by seed."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """Two scans, a start, and the methods that register them."""

    scene: str
    """Place of the target; cross-validation leaves out one place at a time."""
    kind: str
    world: str
    """Kind of world, or folder of real scans; both, joined by "and", where the places differ."""
    sensor: str
    """Kind of sensor; both, joined by "and", where those of the scans differ."""
    target: Cloud
    source: Cloud
    truth: Pose | None
    """True pose, or None for scans of different places, where every pose is wrong."""
    start: Pose | None
    methods: tuple[str, ...]
    tolerance: tuple[float, float] = (MAX_METRES, MAX_DEGREES)


@dataclass(frozen=True)
class Place:
    """Columns of a case that all cases of one place have; see `Case`."""

    scene: str
    world: str
    sensor: str


def real_cases(pairs: Sequence[RealPair], max_pairs: int) -> Iterator[Case]:
    """Yield the cases of one group of real pairs, at most `max_pairs` of them evenly spaced."""
    group = pairs[0].group
    rng = np.random.default_rng(zlib.crc32(group.encode()))
    chosen = np.unique(np.linspace(0, len(pairs) - 1, max_pairs).round().astype(int))
    chosen = [int(index) for index in chosen]
    turns = 3 if len(chosen) > 4 else 8
    for index in chosen:
        pair = pairs[index]
        target, source = pair.load_target(), pair.load_source()
        for turn in headings(group, index, turns):
            place = Place(scene_of(group), world_of(group), sensor_of(group))
            yield from _pair_cases(
                place, target, turn.apply(source), pair.truth @ turn.inverse(),
                tolerance_of(group), rng,
            )  # fmt: skip


def _pair_cases(
    place: Place, target: Cloud, source: Cloud, truth: Pose, tolerance: tuple[float, float],
    rng: np.random.Generator,
) -> Iterator[Case]:  # fmt: skip
    def case(
        kind: str, methods: tuple[str, ...], start: Pose | None = None, **changes: Cloud
    ) -> Case:
        clouds = {"target": target, "source": source, **changes}
        return Case(
            **vars(place), kind=kind, truth=truth, start=start, methods=methods,
            tolerance=tolerance, **clouds,
        )  # fmt: skip

    yield case("any heading", ("auto",))
    yield case("far start", LOCAL, perturbed(truth, 8.0, 45.0, rng))
    yield case("near start", LOCAL[:2], perturbed(truth, 1.5, 8.0, rng))
    sparse = {"target": target[::_STRIDE], "source": source[::_STRIDE]}
    yield case("downsampled", ("auto", "gicp"), perturbed(truth, 1.5, 8.0, rng), **sparse)
    cropped = sector(source, rng)
    yield case("source cropped", ("auto",), source=cropped)
    yield case(
        "source cropped, far start", LOCAL[:1], perturbed(truth, 4.0, 30.0, rng), source=cropped
    )
    yield case("both cropped", ("auto",), source=cropped, target=sector(target, rng))


def other_place_cases(data: Path, count: int, seed: int) -> Iterator[Case]:
    """Yield cases of real scans of different places."""
    rng = np.random.default_rng([seed, 1])
    scans: dict[str, list[Callable[[], Cloud]]] = {}
    groups: dict[str, str] = {}
    for pair in all_pairs(data):
        scans.setdefault(scene_of(pair.group), []).extend((pair.load_target, pair.load_source))
        groups[scene_of(pair.group)] = pair.group
    scenes = sorted(scans)
    for number in range(count):
        one, other = rng.choice(len(scenes), 2, replace=False)
        load_target, load_source = (
            scans[scenes[i]][rng.integers(len(scans[scenes[i]]))] for i in (one, other)
        )
        turn = exp_rotation(np.array([0.0, 0.0, rng.uniform(-math.pi, math.pi)]))
        groups_of_both = [groups[scenes[i]] for i in (one, other)]
        sensors = [sensor_of(group) for group in groups_of_both]
        worlds = [world_of(group) for group in groups_of_both]
        place = Place(scenes[one], pair_name(*worlds), pair_name(*sensors))
        yield from other_place(place, load_target(), load_source() @ turn.T, number, rng)


def other_place(
    place: Place, target: Cloud, source: Cloud, number: int, rng: np.random.Generator
) -> Iterator[Case]:
    """Yield one case of scans of different places; four kinds alternate."""
    start = perturbed(Pose.identity(), 5.0, 180.0, rng)
    kind, methods, begin = (
        ("other place", ("auto",), None),
        ("other place, with start", LOCAL, start),
        ("other place, source cropped", ("auto",), None),
        ("other place, both cropped", ("auto",), None),
    )[number % 4]
    if "cropped" in kind:
        source = sector(source, rng)
    if "both" in kind:
        target = sector(target, rng)
    yield Case(
        **vars(place), kind=kind, target=target, source=source, truth=None, start=begin,
        methods=methods,
    )  # fmt: skip


def simulated_cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Yield cases of one simulated pair per seed, and of scans of two seeds."""
    previous: tuple[Cloud, Place] | None = None
    for seed in seeds:
        rng = np.random.default_rng([seed, 2])
        kind = ("street", "forest", "rugged")[seed % 3]
        sensor = _SIMULATED_SENSORS[seed // 3 % len(_SIMULATED_SENSORS)]
        pair = scan_pair(
            kind, sensor, seed, baseline=_BASELINES[seed % len(_BASELINES)], turn=math.pi
        )
        target, source = pair.target.points, pair.source.points
        place = Place(f"simulated {kind} {seed}", kind, sensor)
        tolerance = (MAX_METRES, MAX_DEGREES)
        yield from _pair_cases(place, target, source, pair.target_from_source, tolerance, rng)
        if previous is not None:
            other, there = previous
            both = Place(place.scene, pair_name(kind, there.world), pair_name(sensor, there.sensor))
            for number in range(4):
                yield from other_place(both, target, other, number, rng)
        yield _noise_case(place, target, rng)
        previous = source, place


def _noise_case(place: Place, target: Cloud, rng: np.random.Generator) -> Case:
    noise = rng.uniform((-30.0, -30.0, -2.0), (30.0, 30.0, 8.0), (20000, 3))
    return Case(
        **vars(place), kind="noise", target=target, source=noise, truth=None, start=None,
        methods=("auto", *LOCAL),
    )  # fmt: skip


def look_alike_cases(seeds: Sequence[int]) -> Iterator[Case]:
    """Yield cases of worlds that look the same from several places."""
    for seed in seeds:
        rng = np.random.default_rng([seed, 3])
        name, world = look_alike_world(seed, rng)
        title = f"look-alike, {name}"
        height = 0.0 if name == "tunnel" else 1.2
        sensor = SENSORS[_SIMULATED_SENSORS[seed % len(_SIMULATED_SENSORS)]]()
        poses = [
            Pose(
                exp_rotation(np.array([0.0, 0.0, rng.uniform(-math.pi, math.pi)])),
                np.array([rng.uniform(-3.0, 3.0), rng.uniform(-0.5, 0.5), height]),
            )
            for _ in range(2)
        ]
        target, source = (simulate_scan(world, sensor, pose, rng).points for pose in poses)
        truth = poses[0].inverse() @ poses[1]
        for methods, start in ((("auto",), None), (LOCAL, perturbed(truth, 4.0, 45.0, rng))):
            yield Case(
                scene=title, kind=title, world=_KINDS.get(name, name), sensor=sensor.name,
                target=target, source=source, truth=truth, start=start, methods=methods,
            )  # fmt: skip


def look_alike_world(seed: int, rng: np.random.Generator) -> tuple[str, World]:
    """Return the name and the world of a seed; worlds have random sizes."""
    makers: tuple[tuple[str, Callable[[], World]], ...] = (
        ("open field", open_field),
        ("corridor", lambda: corridor(rng.uniform(2.0, 8.0), rng.uniform(2.2, 4.0))),
        ("tunnel", lambda: tunnel(rng.uniform(2.5, 6.0))),
        ("shaft", lambda: shaft(rng.uniform(4.0, 20.0))),
        ("crossing", lambda: crossing(rng.uniform(8.0, 20.0), rng.uniform(15.0, 40.0))),
        ("terrace", lambda: terrace(rng.uniform(5.0, 15.0), rng.uniform(8.0, 20.0))),
    )
    name, make = makers[seed % len(makers)]
    return name, make()


def perturbed(pose: Pose, metres: float, degrees: float, rng: np.random.Generator) -> Pose:
    """Return a pose with an error up to the given size, mostly horizontal and in yaw."""
    shift, turn = rng.normal(size=(2, 3)) * [[1.0, 1.0, 0.1], [0.1, 0.1, 1.0]]
    shift *= metres * rng.uniform() / np.linalg.norm(shift)
    turn *= math.radians(degrees) * rng.uniform() / np.linalg.norm(turn)
    return Pose(exp_rotation(turn) @ pose.rotation, pose.translation + shift)


def sector(points: Cloud, rng: np.random.Generator) -> Cloud:
    """Return the points in a random sector, or the whole scan if the sector has under 500."""
    azimuth = np.arctan2(points[:, 1], points[:, 0])
    width, centre = math.radians(rng.choice(_SECTORS)), rng.uniform(-math.pi, math.pi)
    offset = np.abs((azimuth - centre + math.pi) % (2.0 * math.pi) - math.pi)
    inside = points[offset < 0.5 * width]
    return inside if len(inside) > 500 else points


def world_of(group: str) -> str:
    """Return the data set of a group of real pairs, whose scans show one kind of place."""
    return next(name for name in _REAL_SENSORS if group.startswith(name))


def sensor_of(group: str) -> str:
    """Return the kind of sensor of a group of real pairs."""
    return _REAL_SENSORS[world_of(group)]


def pair_name(one: str, other: str) -> str:
    """Return the name of two kinds of sensors or worlds: that of one if both are equal."""
    return one if one == other else " and ".join(sorted((one, other)))


def scene_of(group: str) -> str:
    """Return the place of a group of real pairs."""
    return group.split(",")[0]
