"""What tools say of input that cannot be registered, or is easily registered wrong.

    OMP_NUM_THREADS=1 python benchmarks/silent_failures.py [--seeds 5]

Each cell counts over the seeds: right (and said so), refused (an error, or a claim of failure),
silent (a wrong pose that the tool calls right, or of which it says nothing). Each call runs in a
process of its own, so that one that dies or hangs is counted as that. A pose is right within 0.3 m
and 1 degree where the source is. KISS-ICP claims nothing; of
Open3D a fitness above 0.5 is taken as a claim. Scenes are simulated, so that the truth is exact.
"""

import argparse
import contextlib
import importlib.metadata
import math
import multiprocessing
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from contenders import Cloud, is_solved, pose_error
from peers import available, kiss_icp_peer, open3d_cloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.simulation import hdl_32e, scan_pair, simulate_scan
from scanlock.simulation.scenes.look_alikes import corridor
from tables import machine, print_table

_PATIENCE = 120.0
"""Seconds after which a call counts as hung."""

_MAP = np.array([500_000.0, 5_400_000.0, 100.0])
"""Somewhere on a map, in the metres of UTM."""

_POINTS = 25_000
"""Of a scan, every so many-th of the sensor's."""

_IDENTITY = Pose.identity()

Said = tuple[Pose, bool | None]
"""A pose, and whether the tool claims that it is right; None where it claims nothing."""


@dataclass(frozen=True)
class Tool:
    """A registration as its users call it first: from a start at identity, settings in metres."""

    name: str
    register: Callable[[Cloud, Cloud, Pose], Said]


@dataclass(frozen=True)
class Input:
    """Two clouds, where to start, and the truth; None where every pose is wrong."""

    source: Any
    target: Any
    truth: Pose | None
    start: Pose = _IDENTITY


def ours(name: str) -> Callable[[], Tool]:
    def run(source: Cloud, target: Cloud, start: Pose) -> Said:
        result = register(source=source, target=target, method=METHODS[name], initial=start)
        return result.target_from_source, result.ok

    return lambda: Tool(f"scanlock {name}", run)


def small_gicp_tool() -> Tool:
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose) -> Said:
        result = small_gicp.align(target, source, init_T_target_source=start.matrix)
        return Pose.from_matrix(result.T_target_source), bool(result.converged)

    return Tool("small_gicp GICP", run)


def open3d_tool(kind: str) -> Callable[[], Tool]:
    def make() -> Tool:
        import open3d

        registration = open3d.pipelines.registration
        estimation = {
            "to points": registration.TransformationEstimationPointToPoint,
            "to planes": registration.TransformationEstimationPointToPlane,
            "GICP": registration.TransformationEstimationForGeneralizedICP,
        }[kind]

        def run(source: Cloud, target: Cloud, start: Pose) -> Said:
            moves, stays = open3d_cloud(source), open3d_cloud(target)
            search = open3d.geometry.KDTreeSearchParamHybrid(1.0, 30)
            stays.estimate_normals(search)
            align = (
                registration.registration_generalized_icp
                if kind == "GICP"
                else registration.registration_icp
            )
            result = align(moves, stays, 1.0, start.matrix, estimation())
            return Pose.from_matrix(result.transformation), result.fitness > 0.5

        return Tool(f"Open3D ICP {kind}" if kind != "GICP" else "Open3D GICP", run)

    return make


def kiss_icp_tool() -> Tool:
    peer = kiss_icp_peer()
    return Tool(peer.name, peer.register)


def kiss_matcher_tool() -> Tool:
    import kiss_matcher

    def run(source: Cloud, target: Cloud, start: Pose) -> Said:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, found.translation
        return Pose.from_matrix(matrix), bool(found.valid)

    return Tool("KISS-Matcher", run)


_TOOLS = (
    ours("auto"), ours("gicp"), small_gicp_tool, open3d_tool("to points"),
    open3d_tool("to planes"), open3d_tool("GICP"), kiss_icp_tool, kiss_matcher_tool,
)  # fmt: skip


@cache
def street(seed: int) -> Input:
    pair = scan_pair("street", "hdl_32e", seed, baseline=(0.5, 0.7), turn=math.radians(3.0))
    return Input(
        _thinned(pair.source.points), _thinned(pair.target.points), pair.target_from_source
    )


def _thinned(points: Cloud) -> Cloud:
    return np.array(points[:: max(1, len(points) // _POINTS)])


def inputs(seed: int) -> Iterator[tuple[str, Input]]:
    """Yield the inputs of one seed by name."""
    one, rng = street(seed), np.random.default_rng([seed, 4])
    assert one.truth is not None
    yield "a normal pair", one
    far = Pose(np.eye(3), np.array([500.0, 0.0, 0.0]))
    yield (
        "500 m apart",
        replace(one, source=far.apply(one.source), truth=one.truth @ far.inverse()),
    )
    yield "an empty cloud", replace(one, source=np.zeros((0, 3)), truth=None)
    yield "an (n, 2) array", replace(one, source=one.source[:, :2].copy(), truth=None)
    broken = one.source.copy()
    broken[rng.random(len(broken)) < 0.02] = np.nan
    yield "2 % NaN rows", replace(one, source=broken)
    there = Pose(np.eye(3), _MAP)
    on_map = there @ one.truth @ there.inverse()
    yield (
        "both on a map (UTM)",
        replace(one, source=one.source + _MAP, target=one.target + _MAP, truth=on_map),
    )
    yield "1 m along a corridor", _corridor(rng)
    noise = rng.uniform((-30.0, -30.0, -2.0), (30.0, 30.0, 8.0), (_POINTS, 3))
    yield "a scan of noise", replace(one, source=noise, truth=None)
    yield "a scan of another street", replace(one, source=street(seed + 100).source, truth=None)
    turned = Pose(exp_rotation(np.array([0.0, 0.0, math.pi])), np.zeros(3))
    yield "half a turn wrong", replace(one, start=one.truth @ turned)


def _corridor(rng: np.random.Generator) -> Input:
    poses = [Pose(np.eye(3), np.array([ahead, 0.1 * ahead, 1.2])) for ahead in (0.0, 1.0)]
    scans = [simulate_scan(corridor(), hdl_32e(), pose, rng).points for pose in poses]
    return Input(_thinned(scans[1]), _thinned(scans[0]), poses[0].inverse() @ poses[1])


def outcome(tool: Tool, given: Input) -> tuple[str, int]:
    """Return how a call ended, and how many lines it printed."""
    ours_end, theirs = multiprocessing.Pipe(duplex=False)
    with tempfile.TemporaryFile() as printed:
        child = multiprocessing.get_context("fork").Process(
            target=_call, args=(tool, given, theirs, printed.fileno())
        )
        child.start()
        theirs.close()
        ended = "died"
        if ours_end.poll(_PATIENCE):
            with contextlib.suppress(EOFError):
                ended = ours_end.recv()
        else:
            ended = "hung"
            child.kill()
        child.join()
        printed.seek(0)
        return ended, printed.read().count(b"\n")


def _call(tool: Tool, given: Input, answer: Connection, printed: int) -> None:
    for stream in (1, 2):
        os.dup2(printed, stream)
    try:
        pose, claim = tool.register(given.source, given.target, given.start)
    except Exception as error:
        answer.send(f"refused: {type(error).__name__}")
        return
    right = given.truth is not None and _is_right(pose, given.truth, given.source)
    if claim is None or claim:
        answer.send("right" if right else "silent")
    else:
        answer.send("refused, right" if right else "refused")


def _is_right(pose: Pose, truth: Pose, source: Cloud) -> bool:
    # Where the source is: at the zero of a map a millionth of a turn is metres.
    middle = Pose(np.eye(3), np.nanmedian(source, axis=0))
    return is_solved(pose_error(pose @ middle, truth @ middle))


def version(name: str) -> str:
    try:
        return f"{name} {importlib.metadata.version(name)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{name} missing (pip install {name})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    warm_up()
    tools = available(_TOOLS)
    packages = ("small-gicp", "open3d", "kiss-icp", "kiss-matcher")
    print(f"{', '.join(map(version, packages))}; {machine()}\n")
    found: dict[str, dict[str, Counter[str]]] = {}
    lines: Counter[str] = Counter()
    for seed in range(arguments.seeds):
        for name, given in inputs(seed):
            for tool in tools:
                ended, printed = outcome(tool, given)
                cell = found.setdefault(name, {}).setdefault(tool.name, Counter())
                cell[ended] += 1
                lines[tool.name] += printed
            print(f"seed {seed}: {name}", file=sys.stderr)
    names = [tool.name for tool in tools]
    rows = [
        [
            name,
            *(", ".join(f"{n} {what}" for what, n in sorted(row[tool].items())) for tool in names),
        ]
        for name, row in found.items()
    ]
    silent = [
        sum(row[tool][bad] for row in found.values() for bad in ("silent", "died", "hung"))
        for tool in names
    ]
    rows.append(["wrong without a word, died or hung", *(f"**{count}**" for count in silent)])
    rows.append(["lines printed", *(f"{lines[tool]:,}" for tool in names)])
    print_table(("input", *names), rows)


if __name__ == "__main__":
    main()
