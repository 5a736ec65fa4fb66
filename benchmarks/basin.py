"""Basin of convergence: random starts at growing distance from the true pose.

    python benchmarks/basin.py --data FOLDER [--starts 10] [--axis vertical|random] [--no-peers]

Five pairs of a city drive, ten scans apart. A start is the true pose, turned about the target's
origin by the stated angle and moved by the stated distance in a random direction. With
``vertical`` the axis is up and the direction near level, as a vehicle errs; with ``random``
both are uniform on the sphere. Solved: within 0.3 m and 1 degree at the end.
"""

import argparse
import math
import os
import time
from pathlib import Path

import numpy as np

from contenders import Contender, is_solved, pose_error
from peers import with_start
from real_scans import RealPair, kitti_drive
from scanlock.geometry.pose import Pose
from tables import machine, print_table

LEVELS = ((0.5, 2.0), (2.0, 10.0), (4.0, 20.0), (6.0, 30.0), (10.0, 60.0))
"""Distance [m] and angle [deg] of the starts."""


def random_start(
    truth: Pose, metres: float, degrees: float, axis: str, rng: np.random.Generator
) -> Pose:
    direction, turn = rng.normal(size=3), rng.normal(size=3)
    if axis == "vertical":
        direction[2] *= 0.1
        turn[:2] = 0.0
    direction *= metres / np.linalg.norm(direction)
    turn *= math.radians(degrees) / np.linalg.norm(turn)
    return Pose.from_step(np.concatenate([direction, turn])) @ truth


def row(contender: Contender, pairs: list[RealPair], starts: int, axis: str) -> list[str]:
    cells = [contender.name]
    for metres, degrees in LEVELS:
        solved, claimed_wrongly, seconds, count = 0, 0, 0.0, 0
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
                claimed_wrongly += claimed and not good
                count += 1
        cells.append(f"{solved} / {count} ({1e3 * seconds / count:.0f} ms, {claimed_wrongly})")
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=os.environ.get("SCANLOCK_DATA"))
    parser.add_argument("--starts", type=int, default=10, help="starts a level and pair")
    parser.add_argument("--axis", choices=("vertical", "random"), default="vertical")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    if arguments.data is None:
        parser.error("give --data FOLDER or set SCANLOCK_DATA")
    pairs = list(kitti_drive(arguments.data, 10))[::11]
    print(machine())
    print(f"{len(pairs)} pairs, {arguments.starts} starts each, {arguments.axis} axis")
    print("solved (CPU ms a call, claimed right but wrong)\n")
    found = with_start(peers=not arguments.no_peers)
    for contender in found:
        contender.register(pairs[0].load_source(), pairs[0].load_target(), Pose.identity())
    header = ["method", *(f"{m:g} m, {d:g}°" for m, d in LEVELS)]
    print_table(header, (row(c, pairs, arguments.starts, arguments.axis) for c in found))


if __name__ == "__main__":
    main()
