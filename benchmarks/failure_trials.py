"""Register many pairs whose truth is known; keep what was said of each pose, and what is true.

    python benchmarks/failure_trials.py trials.npz [--data FOLDER] [--jobs 2] [--seed 0]
        [--foreign 3000] [--simulated 120] [--alike 120] [--peer-every 0]

Writes the trials that `confidence.py` reads, as they come. Takes more than an hour on two slow
cores; other seeds give other scenes of simulation and other starts. With `--peer-every K`
small_gicp, Open3D and KISS-Matcher register every K-th case too; they take seconds each.
"""

import argparse
import math
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import failure_cases
from any_start import all_pairs
from contenders import pose_error
from failure_cases import Case
from peers import Judge, available, kiss_matcher_judge, open3d_judge, small_gicp_judge
from scanlock.arrays import Vector
from scanlock.geometry.pose import Pose
from scanlock.registration.methods.auto import Auto
from scanlock.registration.register import register
from scanlock.registration.result import Registration
from scanlock.registration.verification.candidate import INITIAL, second_best
from scanlock.registration.verification.decision import MOST_DRIFT, MOST_RIVALRY, MOST_SLIDE
from scanlock.registration.verification.probability import FEATURES, features
from scanlock.registration.verification.status import Status

WRONG = (99.0, 180.0)
"""The error of any pose between scans of different places [m, deg]."""


def trials_of(case: Case, peers: Sequence[Judge] = ()) -> Iterator[dict[str, Any]]:
    """Yield what came of a case, method by method."""

    def trial(
        method: str, pose: Pose, status: str, score: float, seen: Vector, barred: bool = False
    ) -> dict[str, Any]:
        metres, degrees = WRONG if case.truth is None else pose_error(pose, case.truth)
        is_right = metres <= case.tolerance[0] and degrees <= case.tolerance[1]
        return {
            "scene": case.scene, "kind": case.kind, "method": method, "metres": metres,
            "degrees": degrees, "right": is_right, "status": status, "barred": barred,
            "score": score, "features": seen,
        }  # fmt: skip

    for method in case.methods:
        result = register(source=case.source, target=case.target, method=method, initial=case.start)
        seen = features(result.metrics, result.directions)
        pose, status = result.target_from_source, result.status.value
        yield trial(method, pose, status, result.probability, seen, is_barred(result))
    for peer in peers:
        pose, claimed, score = peer.register(case.source, case.target, case.start)
        status = "ok" if claimed else "failed"
        yield trial(peer.name, pose, status, score, np.full(len(FEATURES), math.nan))


def is_barred(result: Registration) -> bool:
    """Tell whether a pose is not called ok, however probable it is."""
    found, most = second_best(result.candidates), result.metrics.second_best
    is_asked_for = bool(result.candidates) and result.candidates[0].maker == INITIAL
    loyalty = Auto().initial_pose_preference if is_asked_for else 1.0
    return (
        result.status in (Status.NOT_CONVERGED, Status.NO_CORRESPONDENCES)
        or bool(result.weak_directions)
        or result.metrics.drift > MOST_DRIFT
        or found > MOST_RIVALRY * loyalty
        # What is above the best of the candidates is a slide.
        or (most > MOST_SLIDE and not most <= found)
    )


def run(work: Callable[[], Iterator[Case]], every: int) -> list[dict[str, Any]]:
    """Return the trials of some cases; peers get one case of so many, none for 0."""
    makers = (small_gicp_judge, open3d_judge, kiss_matcher_judge)
    peers = available(makers) if every else []
    found: list[dict[str, Any]] = []
    for number, case in enumerate(work()):
        found += trials_of(case, peers if every and number % every == 0 else ())
    return found


def pieces(arguments: argparse.Namespace) -> list[Callable[[], Iterator[Case]]]:
    """Return the work, in pieces that may run side by side."""
    work: list[Callable[[], Iterator[Case]]] = []
    if arguments.data is not None:
        groups: dict[str, list[str]] = {}
        for pair in all_pairs(arguments.data):
            groups.setdefault(pair.group, []).append(pair.name)
        work += [partial(real_work, arguments.data, group) for group in groups]
        for first in range(0, arguments.foreign, 150):
            count = min(150, arguments.foreign - first)
            seed = 10_000 * arguments.seed + first
            work.append(partial(failure_cases.foreign_cases, arguments.data, count, seed))
    for maker, count in (
        (failure_cases.simulated_cases, arguments.simulated),
        (failure_cases.alike_cases, arguments.alike),
    ):
        for first in range(0, count, 12):
            seeds = range(first, min(count, first + 12))
            work.append(partial(maker, [10_000 * (arguments.seed + 1) + seed for seed in seeds]))
    return work


def real_work(data: Path, group: str) -> Iterator[Case]:
    return failure_cases.real_cases([pair for pair in all_pairs(data) if pair.group == group])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, help="where to write the trials (.npz)")
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--foreign", type=int, default=3000, help="real pairs of different places")
    parser.add_argument("--simulated", type=int, default=120, help="simulated scenes")
    parser.add_argument("--alike", type=int, default=120, help="worlds that look alike")
    parser.add_argument("--peer-every", type=int, default=0, help="peers get one case of so many")
    arguments = parser.parse_args()
    work = pieces(arguments)
    found: list[dict[str, Any]] = []
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for number, trials in enumerate(pool.map(partial(run, every=arguments.peer_every), work)):
            found += trials
            # Piece by piece: what took long must not be lost for what comes after it.
            columns = {name: np.array([trial[name] for trial in found]) for name in found[0]}
            np.savez_compressed(arguments.output, **columns)
            print(f"{number + 1} of {len(work)}: {len(found)} trials", flush=True)


if __name__ == "__main__":
    main()
