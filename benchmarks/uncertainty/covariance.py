"""Calibration of covariances: normalised estimation error squared (NEES) by method and estimator.

    python -m benchmarks.uncertainty.covariance [--pairs 12] [--data FOLDER]
        [--estimators sandwich hessian] [--calibrate] [--first-seed SEED]

Simulated pairs have an exact pose: streets, forests and rugged ground, one scene per pair, three
sensors, 1 to 5 m and up to 15 degrees apart, with independent noise. Halves of real scans (see
`split_scans`) have one too, but the same viewpoint, so errors caused by the viewpoint do not
appear. Methods start 0.35 m and 1 degree from the exact pose.

A covariance describes one minimum, and the status indicates whether it is the correct one. The
columns are therefore over poses with status ok; "NEES of all" includes the others, except lost
ones.

A calibrated covariance has a mean NEES of 6, of 3 for translation or rotation alone, and of 2 for
roll and pitch. The bounds contain 95 % of the means over as many pairs. ``--calibrate`` uses other
seeds: the square root of a sixth of the mean NEES is the ratio by which the factor of a method is
to be multiplied. The part of the sampling pattern does not scale with it, so measure again.
"""

import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
from scipy.stats import chi2

from benchmarks._common.arguments import add_data, make_parser
from benchmarks._common.contenders import Cloud
from benchmarks._common.results import Results
from benchmarks._common.scan_halves import halves, scans
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import log_rotation
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.protocol import Method
from scanlock.registration.prepare import PreparedScan, prepare
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod
from scanlock.simulation import scan_pair

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

MAX_METRES = 0.5
"""Errors above this [m] count as lost: the pose is in another minimum."""

COLUMNS = (
    "scans", "method", "estimator", "pairs", "lost or none", "not ok", "NEES (6)", "95 % bounds",
    "translation (3)", "rotation (3)", "roll, pitch (2)", "within 95 %", "maximum", "NEES of all",
    "predicted deviation", "error", "time",
)  # fmt: skip


@dataclass(frozen=True)
class Error:
    """NEES of one pose, with the predicted deviation and the error of the translation [m].

    ``seconds`` is the time of the covariance.
    """

    nees: float
    translation: float
    rotation: float
    roll_pitch: float
    predicted: float
    actual: float
    is_ok: bool
    seconds: float


def error_of(
    estimator: CovarianceMethod,
    source: PreparedScan,
    target: PreparedScan,
    truth: Pose,
    start: Pose,
) -> Error | None:
    """Return the error of one registration; None where it is lost or has no covariance."""
    result = register(source=source, target=target, initial=start, covariance=estimator)
    pose = result.target_from_source
    error = np.concatenate(
        [truth.translation - pose.translation, log_rotation(truth.rotation @ pose.rotation.T)]
    )
    metres = float(np.linalg.norm(error[:3]))
    if result.covariance is None or metres > MAX_METRES:
        return None
    matrix = result.covariance.matrix
    nees, translation, rotation, roll_pitch = (
        float(error[at] @ np.linalg.solve(matrix[at, at], error[at]))
        for at in (slice(0, 6), slice(0, 3), slice(3, 6), slice(3, 5))
    )
    predicted = float(np.sqrt(np.trace(matrix[:3, :3])))
    seconds = result.timings["covariance"]
    return Error(nees, translation, rotation, roll_pitch, predicted, metres, result.ok, seconds)


def simulated(seeds: range, max_distance: float) -> Iterator[tuple[str, Cloud, Cloud, Pose, Pose]]:
    """Yield title, source, target, true pose and start of simulated pairs."""
    for scene, sensor in SCENES:
        for seed in seeds:
            pair = scan_pair(scene, sensor, seed, baseline=(0.2 * max_distance, max_distance))
            truth = pair.target_from_source
            start = near(truth, np.random.default_rng([seed, 7]))
            yield f"simulated {scene}", pair.source.points, pair.target.points, truth, start


def split(data: Path, motions: int) -> Iterator[tuple[str, Cloud, Cloud, Pose, Pose]]:
    """Yield title, source, target, true pose and start of halves of real scans."""
    for title, load in scans(data).items():
        for motion in range(motions):
            rng = np.random.default_rng([zlib.crc32(title.encode()), motion])
            target, source, truth = halves(load(), rng)
            yield "halves of real scans", source, target, truth, near(truth, rng)


def near(truth: Pose, rng: np.random.Generator) -> Pose:
    """Return a start about 0.35 m and 1 degree from the truth."""
    return truth.retract(np.concatenate([rng.normal(0.0, 0.2, 3), rng.normal(0.0, 0.01, 3)]))


def row(title: str, name: str, estimator: str, found: list[Error | None]) -> tuple[str, ...]:
    """Return the cells of `COLUMNS`."""
    errors = [one for one in found if one is not None]
    accepted = [one for one in errors if one.is_ok]
    lost, rejected = len(found) - len(errors), len(errors) - len(accepted)
    head = title, name, estimator, str(len(found)), str(lost), str(rejected)
    if not accepted:
        return (*head, *["-"] * (len(COLUMNS) - len(head)))
    nees = np.array([one.nees for one in accepted])
    low, high = chi2.ppf([0.025, 0.975], 6 * len(nees)) / len(nees)
    return (
        *head,
        f"{nees.mean():.1f}",
        f"{low:.1f} to {high:.1f}",
        f"{np.mean([one.translation for one in accepted]):.1f}",
        f"{np.mean([one.rotation for one in accepted]):.1f}",
        f"{np.mean([one.roll_pitch for one in accepted]):.1f}",
        f"{np.mean(nees < chi2.ppf(0.95, 6)):.0%}",
        f"{nees.max():.0f}",
        f"{np.mean([one.nees for one in errors]):.1f}",
        f"{1e3 * np.median([one.predicted for one in accepted]):.1f} mm",
        f"{1e3 * np.median([one.actual for one in accepted]):.1f} mm",
        f"{1e3 * np.median([one.seconds for one in accepted]):.1f} ms",
    )


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=12, help="pairs per scene and sensor")
    parser.add_argument("--max-distance", type=float, default=5.0, help="between the scans [m]")
    parser.add_argument(
        "--calibrate", action="store_true", help="check the factors, on other seeds"
    )
    parser.add_argument("--first-seed", type=int, help="seed of the first pair")
    parser.add_argument("--methods", nargs="*", default=list(KINDS), choices=list(KINDS))
    parser.add_argument(
        "--estimators", nargs="*", default=["sandwich", "hessian"],
        choices=get_args(CovarianceMethod),
    )  # fmt: skip
    add_data(parser, required=False)
    parser.add_argument("--motions", type=int, default=4, help="motions per real scan")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    results.print_machine()
    found: dict[tuple[str, str, str], list[Error | None]] = {}
    first = arguments.first_seed
    if first is None:
        first = CALIBRATION_SEED if arguments.calibrate else 0
    seeds = range(first, first + arguments.pairs)
    trials = [simulated(seeds, arguments.max_distance)]
    if arguments.data is not None and not arguments.calibrate:
        trials.append(split(arguments.data, arguments.motions))
    for trial in (one for source_of in trials for one in source_of):
        title, source, target, truth, start = trial
        for name in arguments.methods:
            prepared = [prepare(scan, method=KINDS[name]) for scan in (source, target)]
            for estimator in arguments.estimators:
                error = error_of(estimator, prepared[0], prepared[1], truth, start)
                found.setdefault((title, name, estimator), []).append(error)
    for (title, name, estimator), errors in list(found.items()):
        if title.startswith("simulated"):
            found.setdefault(("simulated, all", name, estimator), []).extend(errors)
    rows = (row(*key, errors) for key, errors in sorted(found.items()))
    results.add_table(COLUMNS, rows, title="covariance")


if __name__ == "__main__":
    main()
