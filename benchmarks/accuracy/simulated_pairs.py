"""Simulated pairs with exact truth from the identity: solved pairs, errors and wrong claims.

    python -m benchmarks.accuracy.simulated_pairs [--pairs 20] [--no-peers]

Street and forest, HDL-64E and HDL-32E. Each pair has its own scene and is 3 to 5 m and up to 15
degrees apart. Solved: within 0.3 m and 1 degree of the exact pose.
"""

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import is_solved, pose_error
from benchmarks._common.peers import contenders_with_start
from benchmarks._common.results import Results
from scanlock.geometry.pose import Pose
from scanlock.simulation import scan_pair


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--pairs", type=int, default=20, help="pairs per scene and sensor")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    found = contenders_with_start(peers=not arguments.no_peers)
    rows: list[list[str]] = []
    for scene in ("street", "forest"):
        for sensor in ("hdl_64e", "hdl_32e"):
            pairs = [scan_pair(scene, sensor, seed) for seed in range(arguments.pairs)]
            for contender in found:
                errors: list[tuple[float, float]] = []
                wrong = 0
                for pair in pairs:
                    pose, claimed = contender.register(
                        pair.source.points, pair.target.points, Pose.identity()
                    )
                    errors.append(pose_error(pose, pair.target_from_source))
                    wrong += bool(claimed) and not is_solved(errors[-1])
                solved = sum(is_solved(error) for error in errors)
                median, high = np.median(errors, axis=0), np.percentile(errors, 95, axis=0)
                rows.append(
                    [
                        f"{scene}, {sensor}",
                        contender.name,
                        f"{solved} / {len(pairs)}",
                        f"{median[0]:.3f} m, {median[1]:.3f}°",
                        f"{high[0]:.3f} m, {high[1]:.3f}°",
                        str(wrong),
                    ]
                )
    results.print_machine()
    columns = ("scans", "method", "solved", "median", "95th percentile", "wrong, called ok")
    results.add_table(columns, rows, title="simulated pairs")


if __name__ == "__main__":
    main()
