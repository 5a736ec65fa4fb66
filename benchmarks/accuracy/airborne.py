"""Halves of airborne tiles with a known motion, and wrong poses of tiles: solved, called ok.

    python -m benchmarks.accuracy.airborne --data FOLDER [--seeds 1] [--no-peers] [--only TEXT]

The points of a tile are dealt at random into two halves without shared points. One half is moved
by 2.3 m and 1.5 degrees, or by 10 m and 5 degrees. The error is the root mean squared distance of
its points from their truth, in spacings: median distances between neighbouring points of the other
half. All methods start from the identity, `auto` without a start, or with map coordinates, which
give a start. Other libraries get the coordinates divided by the length scale of the pair, since
their lengths are set for scans of vehicles.

A second table counts wrong poses that `assess` calls ok, and pairs of different tiles. A third one
registers two epochs of one place.
"""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from benchmarks._common.airborne_tiles import EPOCHS, MOTIONS, TileHalves, halves, read_tile, tiles
from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Cloud, Contender, PoseAndClaim, scanlock_contender
from benchmarks._common.peers import (
    available,
    kiss_matcher_peer,
    open3d_features_peer,
    open3d_icp_peer,
    small_gicp_peer,
)
from benchmarks._common.results import Results
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.assess import assess
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS

COLUMNS = (
    "method", "within 0.1 spacings", "within 0.5", "called ok", "wrong, called ok",
    "median error", "largest error", "CPU ms",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Attempt:
    """Registration of two halves by one method; the error is in spacings."""

    tile: str
    error: float
    claimed: bool | None
    seconds: float


def in_map_coordinates(pair: TileHalves) -> PoseAndClaim:
    """Register the halves in map coordinates by the default method."""
    middle = pair.middle
    result = register(source=pair.source + middle, target=pair.target + middle)
    found = result.target_from_source
    shift = found.rotation @ middle + found.translation - middle
    return Pose(found.rotation, shift), result.ok


def without_start(contender: Contender, pair: TileHalves) -> PoseAndClaim:
    """Register the halves about their middle."""
    return contender.register(pair.source, pair.target, None)


def in_units(contender: Contender, pair: TileHalves) -> PoseAndClaim:
    """Register the halves by another library, in units of their length scale."""
    scale = max(PointCloud.from_array(one).length_scale for one in (pair.target, pair.source))
    pose, claimed = contender.register(pair.source / scale, pair.target / scale, None)
    return Pose(pose.rotation, scale * pose.translation), claimed


def runs(peers: bool) -> dict[str, Callable[[TileHalves], PoseAndClaim]]:
    """Return every registration of two halves by name."""
    found: dict[str, Callable[[TileHalves], PoseAndClaim]] = {
        "scanlock auto": partial(without_start, scanlock_contender("auto")),
        "scanlock auto, map coordinates": in_map_coordinates,
        "scanlock gicp": partial(without_start, scanlock_contender("gicp")),
        "scanlock icp": partial(without_start, scanlock_contender("icp")),
    }
    if peers:
        makers = (
            partial(small_gicp_peer, "GICP", 10.0),
            kiss_matcher_peer,
            open3d_icp_peer,
            partial(open3d_features_peer, "RANSAC"),
        )
        found |= {one.name: partial(in_units, one) for one in available(makers)}
    return found


def attempts(
    run: Callable[[TileHalves], PoseAndClaim], clouds: dict[str, Cloud], seeds: int
) -> Iterator[Attempt]:
    """Register the halves of all tiles, after one call to warm up."""
    run(halves(next(iter(clouds.values())), *MOTIONS[0], 0))
    for tile, points in clouds.items():
        for metres, degrees in MOTIONS:
            for seed in range(seeds):
                pair = halves(points, metres, degrees, seed)
                begin = time.process_time()
                pose, claimed = run(pair)
                seconds = time.process_time() - begin
                error = pair.error(pose) / pair.spacing
                yield Attempt(tile=tile, error=error, claimed=claimed, seconds=seconds)


def row_of(name: str, tried: Sequence[Attempt]) -> tuple[str, ...]:
    """Return the cells of `COLUMNS`."""
    errors, count = np.array([one.error for one in tried]), len(tried)
    has_claim = all(one.claimed is not None for one in tried)
    claimed = [bool(one.claimed) for one in tried]
    wrong = sum(one and error > 0.5 for one, error in zip(claimed, errors, strict=True))
    return (
        name,
        f"{int((errors <= 0.1).sum())} / {count}",
        f"{int((errors <= 0.5).sum())} / {count}",
        f"{sum(claimed)} / {count}" if has_claim else "-",
        str(wrong) if has_claim else "-",
        f"{np.median(errors):.3f}",
        f"{errors.max():.2f}",
        f"{1e3 * np.median([one.seconds for one in tried]):.0f}",
    )


def misleading_poses(spacing: float, seed: int) -> dict[str, Pose]:
    """Return motions by name that make a true pose wrong."""
    angle = np.random.default_rng(seed).uniform(-math.pi, math.pi)
    shift = 3.0 * spacing * np.array([math.cos(angle), math.sin(angle), 0.0])
    turns = {f"turned by {one} degrees": math.radians(one) for one in (5, 90, 180)}
    return {
        "shifted by 3 spacings": Pose(np.eye(3), shift),
        "lifted by 3 spacings": Pose(np.eye(3), np.array([0.0, 0.0, 3.0 * spacing])),
        **{
            name: Pose(exp_rotation(np.array([0.0, 0.0, one])), np.zeros(3))
            for name, one in turns.items()
        },
    }


def wrong_pose_rows(clouds: dict[str, Cloud], seeds: int) -> Iterator[tuple[str, ...]]:
    """Yield by kind of wrong pose how many there are, how many are ok, and the probabilities."""
    found: dict[str, list[tuple[bool, float]]] = {}
    for points in clouds.values():
        for seed in range(seeds):
            pair = halves(points, *MOTIONS[0], seed)
            for kind, motion in misleading_poses(pair.spacing, seed).items():
                result = assess(source=pair.source, target=pair.target, pose=motion @ pair.truth)
                found.setdefault(kind, []).append((result.ok, result.probability))
    centred = {name: points - np.median(points, axis=0) for name, points in clouds.items()}
    for method in ("auto", "gicp"):
        for first, target in centred.items():
            for second, source in centred.items():
                if first != second:
                    result = register(source=source, target=target, method=METHODS[method])
                    claims = found.setdefault(f"another tile, {method}", [])
                    claims.append((result.ok, result.probability))
    for kind, claims in found.items():
        known = [one for _, one in claims if not math.isnan(one)]
        yield kind, str(len(claims)), str(sum(ok for ok, _ in claims)), f"{max(known):.3f}"


def epoch_rows(
    target: Cloud, source: Cloud, found: dict[str, Callable[[TileHalves], PoseAndClaim]]
) -> Iterator[tuple[str, ...]]:
    """Yield the motion between two epochs by method; no motion is expected."""
    middle = np.round(np.median(target, axis=0))
    pair = TileHalves(
        target=target - middle,
        source=source - middle,
        truth=Pose.identity(),
        middle=middle,
        spacing=math.nan,
    )
    for name, run in found.items():
        pose, claimed = run(pair)
        x, y, z = (pose.apply(pair.source) - pair.source).mean(axis=0)
        angle = math.degrees(pose.distance(Pose.identity())[1])
        claim = "-" if claimed is None else "yes" if claimed else "no"
        yield name, f"{x:.2f}, {y:.2f}, {z:.2f} m", f"{angle:.2f}°", claim


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--seeds", type=int, default=1, help="halves per tile and motion")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    parser.add_argument("--only", default="", help="only tiles with this text in the name")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    results.print_machine()
    clouds = {n: one for n, one in tiles(arguments.data).items() if arguments.only in n}
    compared = runs(peers=not arguments.no_peers)
    found = {name: list(attempts(run, clouds, arguments.seeds)) for name, run in compared.items()}
    results.add_table(COLUMNS, (row_of(*one) for one in found.items()), title="all tiles")
    for tile in clouds:
        rows = (row_of(n, [one for one in tried if one.tile == tile]) for n, tried in found.items())
        results.add_table(COLUMNS, rows, title=tile)
    results.add_table(
        ("wrong poses", "number", "called ok", "largest probability"),
        wrong_pose_rows(clouds, arguments.seeds),
        title="wrong poses",
    )
    epochs = [read_tile(arguments.data, one) for one in EPOCHS]
    results.add_table(
        ("method", "shift of the middle", "turn", "called ok"),
        epoch_rows(*epochs, compared),
        title="two epochs",
    )


if __name__ == "__main__":
    main()
