"""Real pairs at any heading without an initial pose: solved trials, errors and CPU time.

    python -m benchmarks.robustness.any_start --data FOLDER [--headings 12] [--peer-pairs 6]
        [--only TEXT] [--no-peers] [--each]

The source of every pair is rotated about its z axis by random headings; there is no initial pose. A
trial is solved within 0.3 m and 1 degree of its reference, or within the tolerance in its table
where the reference is less accurate. Peers need seconds per call, so they get some pairs of each
group, evenly spaced, at one heading each. scanlock has an extra row over the same trials.
"""

import argparse
from collections.abc import Sequence

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.peers import contenders_without_start
from benchmarks._common.real_scans import RealPair
from benchmarks._common.results import Results
from benchmarks._common.trials import COLUMNS, Trial, add_overview, run_trial, trial_row
from benchmarks._common.turned_pairs import all_pairs, headings, tolerance_of


def group_trials(
    group: str, pairs: Sequence[RealPair], arguments: argparse.Namespace
) -> dict[str, list[Trial]]:
    """Return the trials of one group by contender."""
    found: dict[str, list[Trial]] = {}
    scanlock, *peers = contenders_without_start(peers=not arguments.no_peers)
    shared = set(np.linspace(0, len(pairs) - 1, arguments.peer_pairs).round().astype(int))
    for index, pair in enumerate(pairs):
        target, source = pair.load_target(), pair.load_source()
        for number, turn in enumerate(headings(group, index, arguments.headings)):
            turned, truth = turn.apply(source), pair.truth @ turn.inverse()
            one = run_trial(scanlock, turned, target, truth, tolerance_of(group))
            found.setdefault(scanlock.name, []).append(one)
            if arguments.each and not (one.solved and one.claimed):
                print(f"{group} {pair.name}, heading {number}: {one}")
            if peers and number == 0 and index in shared:
                found.setdefault(f"{scanlock.name}, trials of the peers", []).append(one)
                for peer in peers:
                    one = run_trial(peer, turned, target, truth, tolerance_of(group))
                    found.setdefault(peer.name, []).append(one)
    return found


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--headings", type=int, default=12, help="headings per pair")
    parser.add_argument("--peer-pairs", type=int, default=6, help="pairs per group for peers")
    parser.add_argument("--only", default="", help="only groups with this text in the name")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument(
        "--each", action="store_true", help="print every trial that is not solved and ok"
    )
    arguments = parser.parse_args()
    pin_to_cores()
    results = Results(arguments.json)
    groups: dict[str, list[RealPair]] = {}
    for pair in all_pairs(arguments.data):
        if arguments.only in pair.group:
            groups.setdefault(pair.group, []).append(pair)
    first = next(iter(groups.values()))[0]
    for contender in contenders_without_start(peers=not arguments.no_peers):
        contender.register(first.load_source(), first.load_target(), None)
    found: dict[str, dict[str, list[Trial]]] = {}
    for group, pairs in groups.items():
        found[group] = group_trials(group, pairs, arguments)
        metres, degrees = tolerance_of(group)
        results.add_table(
            COLUMNS,
            [trial_row(name, trials) for name, trials in found[group].items()],
            title=group,
            note=f"Within {metres:g} m and {degrees:g}°.",
        )
    print()
    results.print_machine()
    add_overview(results, found, "solved")


if __name__ == "__main__":
    main()
