"""Registrations of many pairs with known truth: the features, status and error of each pose.

    python -m benchmarks.uncertainty.failure_trials trials.npz [--data FOLDER] [--jobs 2]
        [--seed 0] [--other-places 3000] [--simulated 120] [--look-alike 120] [--repeating 280]
        [--scenes 48] [--simulated-only] [--peer-every 0]

Writes the trials that `probability` reads. Needs hours on two slow cores, about 0.4 s for each
trial. Other seeds give other simulated scenes and other starts. With ``--peer-every K`` small_gicp,
Open3D and KISS-Matcher register every K-th case too; they need seconds per case.
"""

import argparse
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common import failure_cases, repeating_cases, scene_cases
from benchmarks._common.arguments import add_data, make_parser
from benchmarks._common.contenders import pose_error
from benchmarks._common.failure_cases import Case
from benchmarks._common.peers import (
    ScoredPeer,
    available,
    kiss_matcher_scored,
    open3d_scored,
    small_gicp_scored,
)
from benchmarks._common.real_scans import RealPair
from benchmarks._common.results import Results
from benchmarks._common.turned_pairs import all_pairs
from scanlock.arrays import Vector
from scanlock.geometry.pose import Pose
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.register import register
from scanlock.registration.result import RegistrationResult
from scanlock.registration.verification.candidate import INITIAL, agreement_ratio
from scanlock.registration.verification.decision import (
    MAX_REFINEMENT_SHIFT,
    MAX_RUNNER_UP_RATIO,
    MAX_SHIFTED_SCORE_RATIO,
    has_other_scale,
)
from scanlock.registration.verification.probability import FEATURES, model_inputs
from scanlock.registration.verification.status import Status

WRONG = (99.0, 180.0)
"""Error recorded for scans of different places, where every pose is wrong [m, deg]."""


def trials_of(case: Case, peers: Sequence[ScoredPeer] = ()) -> Iterator[dict[str, Any]]:
    """Yield one trial per method."""

    def trial(
        method: str, pose: Pose, status: str, score: float, values: Vector, vetoed: bool = False
    ) -> dict[str, Any]:
        metres, degrees = WRONG if case.truth is None else pose_error(pose, case.truth)
        is_right = metres <= case.tolerance[0] and degrees <= case.tolerance[1]
        return {
            "scene": case.scene, "kind": case.kind, "world": case.world, "sensor": case.sensor,
            "method": method, "metres": metres,
            "degrees": degrees, "right": is_right, "status": status, "vetoed": vetoed,
            "score": score, "features": values,
        }  # fmt: skip

    for method in case.methods:
        result = register(source=case.source, target=case.target, method=method, initial=case.start)
        values = model_inputs(result.metrics, result.directions)
        pose, status = result.target_from_source, result.status.value
        yield trial(method, pose, status, result.probability, values, is_vetoed(result))
    for peer in peers:
        pose, claimed, score = peer.register(case.source, case.target, case.start)
        status = "ok" if claimed else "failed"
        yield trial(peer.name, pose, status, score, np.full(len(FEATURES), math.nan))


def is_vetoed(result: RegistrationResult) -> bool:
    """Return whether the status is not ok whatever the probability."""
    runner_up, largest = agreement_ratio(result.candidates), result.metrics.runner_up_ratio
    chose_initial = bool(result.candidates) and result.candidates[0].proposed_by == INITIAL
    preference = Auto().initial_pose_preference if chose_initial else 1.0
    return (
        result.status in (Status.NOT_CONVERGED, Status.NO_CORRESPONDENCES)
        or bool(result.degenerate_directions)
        or result.metrics.refinement_shift > MAX_REFINEMENT_SHIFT
        or has_other_scale(result.metrics)
        or result.status is Status.AMBIGUOUS
        or runner_up > MAX_RUNNER_UP_RATIO * preference
        # A value above that of the candidates comes from the score profile.
        or (largest > MAX_SHIFTED_SCORE_RATIO and not largest <= runner_up)
    )


def run(work: Callable[[], Iterator[Case]], every: int) -> list[dict[str, Any]]:
    """Return the trials of some cases; peers get every `every`-th case, none for 0."""
    makers = (small_gicp_scored, open3d_scored, kiss_matcher_scored)
    peers = available(makers) if every else []
    found: list[dict[str, Any]] = []
    for number, case in enumerate(work()):
        found += trials_of(case, peers if every and number % every == 0 else ())
    return found


def case_batches(arguments: argparse.Namespace) -> list[Callable[[], Iterator[Case]]]:
    """Return the cases in batches that can run in parallel."""
    work: list[Callable[[], Iterator[Case]]] = []
    if arguments.data is not None:
        groups: dict[str, list[str]] = {}
        for pair in all_pairs(arguments.data):
            groups.setdefault(pair.group, []).append(pair.name)
        real_cases = partial(failure_cases.real_cases, max_pairs=arguments.real_pairs)
        for make_cases in (real_cases, scene_cases.real_distorted_cases):
            work += [partial(real_work, arguments.data, group, make_cases) for group in groups]
        for first in range(0, arguments.other_places, 150):
            count = min(150, arguments.other_places - first)
            seed = 10_000 * arguments.seed + first
            work.append(partial(failure_cases.other_place_cases, arguments.data, count, seed))
    for make_cases, count in (
        (failure_cases.simulated_cases, arguments.simulated),
        (failure_cases.look_alike_cases, arguments.look_alike),
        (repeating_cases.repeating_cases, arguments.repeating),
        (scene_cases.scene_cases, arguments.scenes),
    ):
        for first in range(0, count, 12):
            seeds = range(first, min(count, first + 12))
            work.append(
                partial(make_cases, [10_000 * (arguments.seed + 1) + seed for seed in seeds])
            )
    return work


def real_work(
    data: Path, group: str, make_cases: Callable[[Sequence[RealPair]], Iterator[Case]]
) -> Iterator[Case]:
    """Yield the cases of one group of real pairs."""
    return make_cases([pair for pair in all_pairs(data) if pair.group == group])


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("output", type=Path, help="file of the trials (.npz)")
    add_data(parser, required=False)
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--real-pairs", type=int, default=15, help="pairs of each group of real pairs"
    )
    parser.add_argument(
        "--other-places", type=int, default=3000, help="real pairs of different places"
    )
    parser.add_argument("--simulated", type=int, default=120, help="simulated scenes")
    parser.add_argument(
        "--look-alike", type=int, default=120, help="worlds without a single correct pose"
    )
    parser.add_argument(
        "--repeating", type=int, default=280, help="worlds with repeated structure and loose things"
    )
    parser.add_argument(
        "--scenes", type=int, default=48, help="simulated scenes with more sensors and distortions"
    )
    parser.add_argument("--simulated-only", action="store_true", help="use no real scans")
    parser.add_argument("--peer-every", type=int, default=0, help="peers get every K-th case")
    arguments = parser.parse_args()
    if arguments.simulated_only:
        arguments.data = None
    results = Results(arguments.json)
    work = case_batches(arguments)
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for number, trials in enumerate(pool.map(partial(run, every=arguments.peer_every), work)):
            found += trials
            # After every batch, so that an interrupted run keeps its trials.
            columns = {name: np.array([trial[name] for trial in found]) for name in found[0]}
            np.savez_compressed(arguments.output, **columns)
            print(f"{number + 1} of {len(work)}: {len(found)} trials", flush=True)
    results.add_table(("trials", "correct", "ok"), [counts(found)], title="trials")


def counts(found: Sequence[dict[str, Any]]) -> list[str]:
    """Return the number of trials, of correct poses, and of poses with status ok."""
    correct = sum(bool(trial["right"]) for trial in found)
    ok = sum(trial["status"] == "ok" for trial in found)
    return [f"{len(found):,}", f"{correct:,}", f"{ok:,}"]


if __name__ == "__main__":
    main()
