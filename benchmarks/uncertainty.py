"""Calibrate covariances: squared errors of poses over what their covariances foretell (NEES).

    python benchmarks/uncertainty.py [--pairs 12] [--data FOLDER] [--ways sandwich hessian]
        [--calibrate] [--first SEED]

Simulated pairs have an exact pose: streets, forests and rugged ground that are drawn anew for each
pair, three sensors, 1 to 5 m apart and up to 15 degrees turned, every return with its own noise.
Halves of real scans, see split_scans.py, have one too; they share their viewpoint, so what is wrong
by the viewpoint does not show there. Methods start 0.35 m and 1 degree from the exact pose.

A covariance is that of a minimum: whether it is the right one, the status says. So the columns are
of poses that are called ok; "NEES of all" is of those that are not as well, but places lost.

A calibrated covariance has a mean of 6 over all directions, of 3 over translations or rotations
alone and of 2 over roll and pitch; the bounds hold 95 % of such means over as many pairs. With
`--calibrate` the factors of the methods are left out, on scenes of the same kinds but of other
seeds: the root of a sixth of the mean is what a factor should be. That of tilts, which all share,
stays: it is right where the mean over roll and pitch is a third of the whole, over all methods.
"""

import argparse
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scanlock.registration.methods.calibration import covariance_factor
from scipy.stats import chi2

from contenders import Cloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.protocol import Method
from scanlock.registration.methods.transform_estimation import TransformEstimation
from scanlock.registration.prepare import PreparedScan, prepare
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod
from scanlock.simulation import scan_pair
from split_scans import halves, scans
from tables import machine, print_table

TO_PLANES = Icp(estimation=TransformEstimation(algorithm="gauss-newton", residual="point-to-plane"))
KINDS: dict[str, Method[Any]] = {
    "icp to planes": TO_PLANES,
    **{name: method for name, method in METHODS.items() if name != "icp-annealed"},
}
SCENES = (
    ("street", "hdl_64e"), ("street", "hdl_32e"), ("forest", "hdl_64e"), ("forest", "hdl_32e"),
    ("street", "os1_64"), ("forest", "os1_64"), ("rugged", "hdl_64e"), ("rugged", "os1_64"),
)  # fmt: skip
CALIBRATION_SEED = 500

LOST = 0.5
"""An error above this [m] is another place, which no covariance of one minimum foretells."""

HEADER = (
    "scans", "method", "way", "pairs", "lost or untold", "not ok", "NEES (6)", "95 % bounds",
    "translation (3)", "rotation (3)", "tilt (2)", "within 95 %", "largest", "NEES of all",
    "deviation told", "error", "time of it",
)  # fmt: skip


@dataclass(frozen=True)
class Error:
    """How far a pose is off, squared and divided by its covariance; and both in metres.

    And whether it is called ok, and the seconds that the covariance took.
    """

    both: float
    translation: float
    rotation: float
    tilt: float
    told: float
    found: float
    is_ok: bool
    seconds: float


def tried(
    way: CovarianceMethod,
    source: PreparedScan,
    target: PreparedScan,
    truth: Pose,
    start: Pose,
    raw: bool,
) -> Error | None:
    """Return the error of one registration; None for a place lost or no covariance told."""
    result = register(source=source, target=target, initial=start, covariance=way)
    pose = result.target_from_source
    error = np.concatenate(
        [truth.translation - pose.translation, log_rotation(truth.rotation @ pose.rotation.T)]
    )
    metres = float(np.linalg.norm(error[:3]))
    if result.covariance is None or metres > LOST:
        return None
    matrix = result.covariance.matrix
    if raw and way == "sandwich":
        matrix = matrix / covariance_factor(source.method) ** 2
    both, translation, rotation, tilt = (
        float(error[at] @ np.linalg.solve(matrix[at, at], error[at]))
        for at in (slice(0, 6), slice(0, 3), slice(3, 6), slice(3, 5))
    )
    told = float(np.sqrt(np.trace(matrix[:3, :3])))
    seconds = result.timings["covariance"]
    return Error(both, translation, rotation, tilt, told, metres, result.ok, seconds)


def simulated(seeds: range, farthest: float) -> Iterator[tuple[str, Cloud, Cloud, Pose, Pose]]:
    for scene, sensor in SCENES:
        for seed in seeds:
            pair = scan_pair(scene, sensor, seed, baseline=(0.2 * farthest, farthest))
            truth = pair.target_from_source
            start = near(truth, np.random.default_rng([seed, 7]))
            yield f"simulated {scene}", pair.source.points, pair.target.points, truth, start


def split(data: Path, moves: int) -> Iterator[tuple[str, Cloud, Cloud, Pose, Pose]]:
    for title, load in scans(data).items():
        for move in range(moves):
            rng = np.random.default_rng([zlib.crc32(title.encode()), move])
            target, source, truth = halves(load(), rng)
            yield "halves of real scans", source, target, truth, near(truth, rng)


def near(truth: Pose, rng: np.random.Generator) -> Pose:
    """Return a start about 0.35 m and 1 degree from the truth."""
    return truth.retract(np.concatenate([rng.normal(0.0, 0.2, 3), rng.normal(0.0, 0.01, 3)]))


def row(scans: str, name: str, way: str, found: list[Error | None]) -> tuple[str, ...]:
    told = [one for one in found if one is not None]
    known = [one for one in told if one.is_ok]
    lost, doubted = len(found) - len(told), len(told) - len(known)
    head = scans, name, way, str(len(found)), str(lost), str(doubted)
    if not known:
        return (*head, *["-"] * (len(HEADER) - len(head)))
    nees = np.array([one.both for one in known])
    low, high = chi2.ppf([0.025, 0.975], 6 * len(nees)) / len(nees)
    return (
        *head,
        f"{nees.mean():.1f}",
        f"{low:.1f} to {high:.1f}",
        f"{np.mean([one.translation for one in known]):.1f}",
        f"{np.mean([one.rotation for one in known]):.1f}",
        f"{np.mean([one.tilt for one in known]):.1f}",
        f"{np.mean(nees < chi2.ppf(0.95, 6)):.0%}",
        f"{nees.max():.0f}",
        f"{np.mean([one.both for one in told]):.1f}",
        f"{1e3 * np.median([one.told for one in known]):.1f} mm",
        f"{1e3 * np.median([one.found for one in known]):.1f} mm",
        f"{1e3 * np.median([one.seconds for one in known]):.1f} ms",
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=12, help="pairs of each scene and sensor")
    parser.add_argument("--farthest", type=float, default=5.0, help="most metres between scans")
    parser.add_argument("--calibrate", action="store_true", help="the scenes of the factors")
    parser.add_argument("--first", type=int, help="seed of the first pair, or that of its purpose")
    parser.add_argument("--methods", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument(
        "--ways", nargs="*", default=["sandwich", "hessian"], choices=get_args(CovarianceMethod)
    )
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--moves", type=int, default=4, help="moves of each real scan")
    arguments = parser.parse_args()
    print(machine(), "\n")
    found: dict[tuple[str, str, str], list[Error | None]] = {}
    first = arguments.first
    if first is None:
        first = CALIBRATION_SEED if arguments.calibrate else 0
    seeds = range(first, first + arguments.pairs)
    trials = [simulated(seeds, arguments.farthest)]
    if arguments.data is not None and not arguments.calibrate:
        trials.append(split(arguments.data, arguments.moves))
    for trial in (one for some in trials for one in some):
        title, source, target, truth, start = trial
        for name in arguments.methods:
            ready = [prepare(scan, method=KINDS[name]) for scan in (source, target)]
            for way in arguments.ways:
                error = tried(way, ready[0], ready[1], truth, start, arguments.calibrate)
                found.setdefault((title, name, way), []).append(error)
    for (title, name, way), errors in list(found.items()):
        if title.startswith("simulated"):
            found.setdefault(("simulated, all", name, way), []).extend(errors)
    print_table(HEADER, (row(*key, errors) for key, errors in sorted(found.items())))


if __name__ == "__main__":
    main()
