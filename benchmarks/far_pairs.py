"""Register simulated pairs 0 to 30 m apart with any heading and no initial pose.

    python benchmarks/far_pairs.py [--pairs 40] [--no-peers] [--each]

Street and forest, drawn anew from each seed; HDL-64E, OS1-64 and HDL-32E in turn; one pair of each
distance class in each scene. Solved: within 0.3 m and 1 degree of the exact pose. The last table
counts within 2 m and 5 degrees, the measure of published results on loop closures.
"""

import argparse
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from cores import hold_to_cores
from peers import without_start
from scanlock.simulation import SCENES, SimulatedPair, scan_pair
from tables import machine, print_table
from trials import HEADER, Trial, print_overview, row, tried

BASELINES = ((0.0, 10.0), (10.0, 20.0), (20.0, 30.0))
SENSORS = ("hdl_64e", "os1_64", "hdl_32e")


def far_pair(
    kind: str, seed: int, baselines: Sequence[tuple[float, float]] = BASELINES
) -> Iterator[tuple[tuple[float, float], SimulatedPair]]:
    """Yield a pair of each distance class in one scene."""
    scene = SCENES[kind](np.random.default_rng(seed))
    for baseline in baselines:
        sensor = SENSORS[seed % 3]
        yield baseline, scan_pair(scene, sensor, seed, baseline=baseline, turn=math.pi)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=40, help="scenes of each kind")
    parser.add_argument("--first-seed", type=int, default=0, help="of the scenes")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument("--each", action="store_true", help="print what is not solved and claimed")
    arguments = parser.parse_args()
    hold_to_cores()
    found: dict[str, dict[str, list[Trial]]] = {}
    contenders = without_start(peers=not arguments.no_peers)
    first = scan_pair("street", SENSORS[0], arguments.first_seed)
    for one in contenders:
        one.register(first.source.points, first.target.points, None)
    for kind in ("street", "forest"):
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.pairs):
            for baseline, pair in far_pair(kind, seed):
                group = f"{kind}, {baseline[0]:g}-{baseline[1]:g} m"
                for one in contenders:
                    trial = tried(
                        one, pair.source.points, pair.target.points, pair.target_from_source
                    )
                    found.setdefault(group, {}).setdefault(one.name, []).append(trial)
                    if arguments.each and not (trial.solved and trial.claimed):
                        print(f"{group} {SENSORS[seed % 3]} {seed}, {one.name}: {trial}")
    for group, by_name in found.items():
        print(f"\n### {group}\n")
        print_table(HEADER, [row(name, trials) for name, trials in by_name.items()])
    print(f"\n{machine()}\n\nWithin 0.3 m and 1°.\n")
    print_overview(found)
    print("\nWithin 2 m and 5°.\n")
    print_overview(
        {
            group: {
                name: [replace(one, tolerance=(2.0, 5.0)) for one in trials]
                for name, trials in by_name.items()
            }
            for group, by_name in found.items()
        }
    )


if __name__ == "__main__":
    main()
