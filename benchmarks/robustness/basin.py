"""Basin of convergence: solved starts by their distance from the true pose.

    python -m benchmarks.robustness.basin --data FOLDER [--starts 10] [--axis vertical|random]
        [--no-peers]

Five pairs of a city drive, ten scans apart. A start is the true pose with a rotation about the
target's origin and a translation in a random direction. ``vertical``: vertical axis and nearly
horizontal translation, as for a vehicle. ``random``: both uniform on the sphere. Solved: within 0.3
m and 1 degree at the end.
"""

import time

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Contender, is_solved, pose_error
from benchmarks._common.peers import contenders_with_start
from benchmarks._common.real_scans import RealPair, kitti_drive
from benchmarks._common.results import Results
from benchmarks._common.starts import LEVELS, random_start
from scanlock.geometry.pose import Pose


def row(contender: Contender, pairs: list[RealPair], starts: int, axis: str) -> list[str]:
    """Return the cells of one contender, one level after the other."""
    cells = [contender.name]
    for metres, degrees in LEVELS:
        solved, wrong_but_ok, seconds, count = 0, 0, 0.0, 0
        for index, pair in enumerate(pairs):
            rng = np.random.default_rng([index, int(metres * 10)])
            target, source = pair.load_target(), pair.load_source()
            for _ in range(starts):
                start = random_start(pair.truth, metres, degrees, axis, rng)
                begin = time.process_time()
                pose, claimed = contender.register(source, target, start)
                seconds += time.process_time() - begin
                good = is_solved(pose_error(pose, pair.truth))
                solved += good
                wrong_but_ok += bool(claimed) and not good
                count += 1
        cells.append(f"{solved} / {count} ({1e3 * seconds / count:.0f} ms, {wrong_but_ok})")
    return cells


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--starts", type=int, default=10, help="starts per level and pair")
    parser.add_argument("--axis", choices=("vertical", "random"), default="vertical")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    pairs = list(kitti_drive(arguments.data, 10))[::11]
    results.print_machine()
    found = contenders_with_start(peers=not arguments.no_peers)
    for contender in found:
        contender.register(pairs[0].load_source(), pairs[0].load_target(), Pose.identity())
    results.add_table(
        ["method", *(f"{m:g} m, {d:g}°" for m, d in LEVELS)],
        (row(one, pairs, arguments.starts, arguments.axis) for one in found),
        title="basin",
        note=f"{len(pairs)} pairs, {arguments.starts} starts each, {arguments.axis} axis. "
        "Solved (CPU ms per call, wrong but called ok).",
    )


if __name__ == "__main__":
    main()
