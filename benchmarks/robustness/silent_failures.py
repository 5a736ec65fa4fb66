"""Wrong poses reported as valid, on input that cannot be registered or is easily misregistered.

    OMP_NUM_THREADS=1 python -m benchmarks.robustness.silent_failures [--seeds 5]

A cell counts the outcomes over the seeds. "right": a correct pose, reported as valid. "refused": an
error, or a pose reported as invalid. "silent": a wrong pose that is reported as valid or without
any report. "died", "hung": the process ended or exceeded 120 s; each call has its own process. A
pose is correct within 0.3 m and 1 degree at the source. KISS-ICP reports no validity; for Open3D a
fitness above 0.5 counts as valid. The scenes are simulated, so the truth is exact.
"""

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

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Cloud, PoseAndClaim, is_solved, pose_error
from benchmarks._common.peers import available, kiss_icp_peer, open3d_cloud
from benchmarks._common.results import Results
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.warm_up import warm_up
from scanlock.simulation import hdl_32e, scan_pair, simulate_scan
from scanlock.simulation.scenes.look_alikes import corridor

_MAX_SECONDS = 120.0
"""Duration after which a call counts as hung [s]."""

_MAP = np.array([500_000.0, 5_400_000.0, 100.0])
"""A position in UTM coordinates [m]."""

_POINTS = 25_000
"""Approximate number of points per scan, evenly spaced rows of the sensor's."""

_IDENTITY = Pose.identity()


@dataclass(frozen=True)
class Tool:
    """A registration with default settings."""

    name: str
    register: Callable[[Cloud, Cloud, Pose], PoseAndClaim]


@dataclass(frozen=True)
class Input:
    """Two clouds, a start, and the true pose, or None where every pose is wrong."""

    source: Any
    target: Any
    truth: Pose | None
    start: Pose = _IDENTITY


def scanlock_tool(name: str) -> Callable[[], Tool]:
    """Return a function that makes a method of scanlock."""

    def run(source: Cloud, target: Cloud, start: Pose) -> PoseAndClaim:
        result = register(source=source, target=target, method=METHODS[name], initial=start)
        return result.target_from_source, result.ok

    return lambda: Tool(f"scanlock {name}", run)


def small_gicp_tool() -> Tool:
    """Return G-ICP of small_gicp."""
    import small_gicp

    def run(source: Cloud, target: Cloud, start: Pose) -> PoseAndClaim:
        result = small_gicp.align(target, source, init_T_target_source=start.matrix)
        return Pose.from_matrix(result.T_target_source), bool(result.converged)

    return Tool("small_gicp GICP", run)


def open3d_tool(kind: str) -> Callable[[], Tool]:
    """Return a function that makes a local registration of Open3D."""

    def make() -> Tool:
        import open3d

        registration = open3d.pipelines.registration
        estimation = {
            "to points": registration.TransformationEstimationPointToPoint,
            "to planes": registration.TransformationEstimationPointToPlane,
            "GICP": registration.TransformationEstimationForGeneralizedICP,
        }[kind]

        def run(source: Cloud, target: Cloud, start: Pose) -> PoseAndClaim:
            clouds = open3d_cloud(source), open3d_cloud(target)
            search = open3d.geometry.KDTreeSearchParamHybrid(1.0, 30)
            clouds[1].estimate_normals(search)
            align = (
                registration.registration_generalized_icp
                if kind == "GICP"
                else registration.registration_icp
            )
            result = align(*clouds, 1.0, start.matrix, estimation())
            return Pose.from_matrix(result.transformation), result.fitness > 0.5

        return Tool(f"Open3D ICP {kind}" if kind != "GICP" else "Open3D GICP", run)

    return make


def kiss_icp_tool() -> Tool:
    """Return KISS-ICP with the target as its map."""
    peer = kiss_icp_peer()
    return Tool(peer.name, peer.register)


def kiss_matcher_tool() -> Tool:
    """Return KISS-Matcher at voxels of 0.3 m."""
    import kiss_matcher

    def run(source: Cloud, target: Cloud, start: Pose) -> PoseAndClaim:
        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(0.3))
        found = matcher.estimate(source.astype(np.float32), target.astype(np.float32))
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = found.rotation, found.translation
        return Pose.from_matrix(matrix), bool(found.valid)

    return Tool("KISS-Matcher", run)


_TOOLS = (
    scanlock_tool("auto"), scanlock_tool("gicp"), small_gicp_tool, open3d_tool("to points"),
    open3d_tool("to planes"), open3d_tool("GICP"), kiss_icp_tool, kiss_matcher_tool,
)  # fmt: skip


@cache
def street(seed: int) -> Input:
    """Return two scans of a street, 0.5 to 0.7 m apart."""
    pair = scan_pair("street", "hdl_32e", seed, baseline=(0.5, 0.7), turn=math.radians(3.0))
    return Input(
        _downsampled(pair.source.points), _downsampled(pair.target.points), pair.target_from_source
    )


def _downsampled(points: Cloud) -> Cloud:
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
    shift = Pose(np.eye(3), _MAP)
    on_map = shift @ one.truth @ shift.inverse()
    yield (
        "both in map coordinates (UTM)",
        replace(one, source=one.source + _MAP, target=one.target + _MAP, truth=on_map),
    )
    yield "1 m along a corridor", _corridor(rng)
    noise = rng.uniform((-30.0, -30.0, -2.0), (30.0, 30.0, 8.0), (_POINTS, 3))
    yield "a scan of noise", replace(one, source=noise, truth=None)
    yield "a scan of another street", replace(one, source=street(seed + 100).source, truth=None)
    turned = Pose(exp_rotation(np.array([0.0, 0.0, math.pi])), np.zeros(3))
    yield "start with half a turn", replace(one, start=one.truth @ turned)


def _corridor(rng: np.random.Generator) -> Input:
    poses = [Pose(np.eye(3), np.array([ahead, 0.1 * ahead, 1.2])) for ahead in (0.0, 1.0)]
    scans = [simulate_scan(corridor(), hdl_32e(), pose, rng).points for pose in poses]
    return Input(_downsampled(scans[1]), _downsampled(scans[0]), poses[0].inverse() @ poses[1])


def outcome(tool: Tool, given: Input) -> tuple[str, int]:
    """Return the outcome of a call, and the number of lines that it printed."""
    receiver, sender = multiprocessing.Pipe(duplex=False)
    with tempfile.TemporaryFile() as printed:
        child = multiprocessing.get_context("fork").Process(
            target=_call, args=(tool, given, sender, printed.fileno())
        )
        child.start()
        sender.close()
        result = "died"
        if receiver.poll(_MAX_SECONDS):
            with contextlib.suppress(EOFError):
                result = receiver.recv()
        else:
            result = "hung"
            child.kill()
        child.join()
        printed.seek(0)
        return result, printed.read().count(b"\n")


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
    # At the source, since at the origin of a map a rotation of 1e-6 is metres.
    centre = Pose(np.eye(3), np.nanmedian(source, axis=0))
    return is_solved(pose_error(pose @ centre, truth @ centre))


def version(name: str) -> str:
    """Return a package with its version, or the command to install it."""
    try:
        return f"{name} {importlib.metadata.version(name)}"
    except importlib.metadata.PackageNotFoundError:
        return f"{name} missing (pip install {name})"


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    arguments = parser.parse_args()
    results = Results(arguments.json)
    warm_up()
    tools = available(_TOOLS)
    packages = ("small-gicp", "open3d", "kiss-icp", "kiss-matcher")
    print(f"{', '.join(map(version, packages))}; {results.machine_line}\n")
    found: dict[str, dict[str, Counter[str]]] = {}
    lines: Counter[str] = Counter()
    for seed in range(arguments.seeds):
        for name, given in inputs(seed):
            for tool in tools:
                result, printed = outcome(tool, given)
                cell = found.setdefault(name, {}).setdefault(tool.name, Counter())
                cell[result] += 1
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
    rows.append(["silent, died or hung", *(f"**{count}**" for count in silent)])
    rows.append(["lines printed", *(f"{lines[tool]:,}" for tool in names)])
    results.add_table(("input", *names), rows, title="silent failures")


if __name__ == "__main__":
    main()
