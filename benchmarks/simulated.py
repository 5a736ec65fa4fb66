"""Register simulated pairs with exact truth; print solved, errors and wrong claims.

    python benchmarks/simulated.py [--pairs 20] [--no-peers]

Street and forest, HDL-64E and HDL-32E; each pair is 3 to 5 m apart and up to 15 degrees turned,
in a scene of its own drawn from its seed, and starts from the identity. Solved: within 0.3 m and
1 degree of the exact pose.
"""

import argparse

import numpy as np

from contenders import is_solved, pose_error
from peers import with_start
from scanlock.geometry.pose import Pose
from scanlock.simulation import scan_pair
from tables import machine, print_table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--pairs", type=int, default=20, help="pairs of each scene and sensor")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    found = with_start(peers=not arguments.no_peers)
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
                    wrong += claimed and not is_solved(errors[-1])
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
    print(machine(), "\n")
    header = ("scans", "method", "solved", "median", "95th percentile", "claimed wrongly")
    print_table(header, rows)


if __name__ == "__main__":
    main()
