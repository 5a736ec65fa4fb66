"""Simulated pairs 0 to 30 m apart at any heading, without an initial pose.

    python -m benchmarks.robustness.far_pairs [--pairs 40] [--no-peers] [--each]

Street and forest, one scene per seed; HDL-64E, OS1-64 and HDL-32E alternate. Each scene has one
pair per distance class. Solved: within 0.3 m and 1 degree of the exact pose. The last table counts
within 2 m and 5 degrees, the criterion of published results on loop closures.
"""

from dataclasses import replace

from benchmarks._common.arguments import make_parser
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.far_pairs import SENSORS, far_pairs
from benchmarks._common.peers import contenders_without_start
from benchmarks._common.results import Results
from benchmarks._common.trials import COLUMNS, Trial, add_overview, run_trial, trial_row
from scanlock.simulation import scan_pair


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=40, help="scenes per kind")
    parser.add_argument("--first-seed", type=int, default=0, help="first seed of the scenes")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument(
        "--each", action="store_true", help="print every trial that is not solved and ok"
    )
    arguments = parser.parse_args()
    pin_to_cores()
    results = Results(arguments.json)
    found: dict[str, dict[str, list[Trial]]] = {}
    contenders = contenders_without_start(peers=not arguments.no_peers)
    first = scan_pair("street", SENSORS[0], arguments.first_seed)
    for one in contenders:
        one.register(first.source.points, first.target.points, None)
    for kind in ("street", "forest"):
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.pairs):
            for baseline, pair in far_pairs(kind, seed):
                group = f"{kind}, {baseline[0]:g}-{baseline[1]:g} m"
                for one in contenders:
                    trial = run_trial(
                        one, pair.source.points, pair.target.points, pair.target_from_source
                    )
                    found.setdefault(group, {}).setdefault(one.name, []).append(trial)
                    if arguments.each and not (trial.solved and trial.claimed):
                        print(f"{group} {SENSORS[seed % 3]} {seed}, {one.name}: {trial}")
    for group, by_name in found.items():
        rows = [trial_row(name, trials) for name, trials in by_name.items()]
        results.add_table(COLUMNS, rows, title=group)
    print()
    results.print_machine()
    add_overview(results, found, "within 0.3 m and 1°")
    add_overview(
        results,
        {
            group: {
                name: [replace(one, tolerance=(2.0, 5.0)) for one in trials]
                for name, trials in by_name.items()
            }
            for group, by_name in found.items()
        },
        "within 2 m and 5°",
    )


if __name__ == "__main__":
    main()
