"""Real pairs with both scans turned in space, without an initial pose: found, ok and CPU time.

    python -m benchmarks.robustness.any_rotation --data FOLDER [--pairs 4] [--rotations 1]
        [--only TEXT] [--no-peers] [--each]

Both scans of a pair are rotated about their sensors by random rotations, so neither z axis is up.
Each group gives some pairs, evenly spaced. A trial is solved within the tolerance of its group, as
in `benchmarks.robustness.any_start`.
"""

import argparse
from collections.abc import Iterator

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Contender, scanlock_contender
from benchmarks._common.cores import pin_to_cores
from benchmarks._common.peers import available, kiss_matcher_peer
from benchmarks._common.real_scans import RealPair
from benchmarks._common.results import Results
from benchmarks._common.trials import COLUMNS, Trial, add_overview, run_trial, trial_row
from benchmarks._common.turned_pairs import all_pairs, rotations, tolerance_of


def group_trials(
    group: str,
    pairs: list[tuple[int, RealPair]],
    contenders: list[Contender],
    arguments: argparse.Namespace,
) -> dict[str, list[Trial]]:
    """Return the trials of the numbered pairs of a group by contender."""
    found: dict[str, list[Trial]] = {one.name: [] for one in contenders}
    for index, pair in pairs:
        turns = iter(rotations(group, index, 2 * arguments.rotations))
        for number, (target_turn, source_turn) in enumerate(zip(turns, turns, strict=True)):
            target = target_turn.apply(pair.load_target())
            source = source_turn.apply(pair.load_source())
            truth = target_turn @ pair.truth @ source_turn.inverse()
            for contender in contenders:
                one = run_trial(contender, source, target, truth, tolerance_of(group))
                found[contender.name].append(one)
                if arguments.each and not (one.solved and one.claimed):
                    print(f"{contender.name}: {group} {pair.name}, rotation {number}: {one}")
    return found


def chosen_pairs(arguments: argparse.Namespace) -> Iterator[tuple[str, list[tuple[int, RealPair]]]]:
    """Yield the groups, each with some of its pairs and their numbers, evenly spaced."""
    groups: dict[str, list[RealPair]] = {}
    for pair in all_pairs(arguments.data):
        if arguments.only in pair.group:
            groups.setdefault(pair.group, []).append(pair)
    for group, pairs in groups.items():
        rows = np.linspace(0, len(pairs) - 1, arguments.pairs).round().astype(int).tolist()
        yield group, [(row, pairs[row]) for row in dict.fromkeys(rows)]


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--pairs", type=int, default=4, help="pairs of each group")
    parser.add_argument("--rotations", type=int, default=1, help="rotations of each pair")
    parser.add_argument("--only", default="", help="only groups with this text in the name")
    parser.add_argument("--no-peers", action="store_true", help="scanlock only")
    parser.add_argument(
        "--each", action="store_true", help="print every trial that is not solved and ok"
    )
    arguments = parser.parse_args()
    pin_to_cores()
    contenders = [scanlock_contender("auto")]
    if not arguments.no_peers:
        contenders += available([kiss_matcher_peer])
    groups = dict(chosen_pairs(arguments))
    first = next(iter(groups.values()))[0][1]
    for contender in contenders:
        contender.register(first.load_source(), first.load_target(), None)
    results = Results(arguments.json)
    found: dict[str, dict[str, list[Trial]]] = {}
    for group, pairs in groups.items():
        found[group] = group_trials(group, pairs, contenders, arguments)
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
