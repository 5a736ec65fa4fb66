"""Random halves of one real scan with a known motion: errors of fine registration.

    python -m benchmarks.accuracy.split_scans --data FOLDER [--motions 20] [--no-peers]

The points of a scan are divided at random. One half is moved by up to 1 m, 10 degrees of yaw and 2
degrees of roll and pitch; this motion is the exact truth, and methods start from it. The errors are
those of sampling and noise alone. One table per scan, then one over all scans.
"""

import zlib
from functools import partial

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.contenders import Contender, pose_error, scanlock_contender
from benchmarks._common.peers import available, small_gicp_peer
from benchmarks._common.results import Results
from benchmarks._common.scan_halves import halves, scans

METHODS = ("auto", "gicp", "ndt-d2d")
PEERS = ("GICP", "VGICP")

Error = tuple[float, float]


def contenders(peers: bool) -> list[Contender]:
    """Return the methods and, on request, small_gicp."""
    found = [scanlock_contender(method) for method in METHODS]
    if peers:
        found += available(partial(small_gicp_peer, kind) for kind in PEERS)
    return found


def error_row(name: str, errors: list[Error]) -> tuple[str, ...]:
    """Return the median and the 95th percentile of errors in metres and degrees."""
    metres, degrees = np.transpose(errors)
    return (
        name,
        f"{1e3 * np.median(metres):.2f} mm, {np.median(degrees):.4f}°",
        f"{1e3 * np.percentile(metres, 95):.2f} mm, {np.percentile(degrees, 95):.4f}°",
    )


def add_errors(results: Results, title: str, found: dict[str, list[Error]]) -> None:
    """Add the table of one scan."""
    columns = ("method", "median", "95th percentile")
    rows = (error_row(name, errors) for name, errors in found.items())
    results.add_table(columns, rows, title=title)


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--motions", type=int, default=20, help="motions per scan")
    parser.add_argument("--no-peers", action="store_true", help="scanlock's methods only")
    arguments = parser.parse_args()
    compared = contenders(peers=not arguments.no_peers)
    results = Results(arguments.json)
    results.print_machine()
    over_all: dict[str, list[Error]] = {one.name: [] for one in compared}
    for title, load in scans(arguments.data).items():
        found: dict[str, list[Error]] = {one.name: [] for one in compared}
        for motion in range(arguments.motions):
            rng = np.random.default_rng([zlib.crc32(title.encode()), motion])
            target, source, truth = halves(load(), rng)
            for one in compared:
                pose, _ = one.register(source, target, truth)
                found[one.name].append(pose_error(pose, truth))
        add_errors(results, title, found)
        for name, errors in found.items():
            over_all[name] += errors
    add_errors(results, "all scans", over_all)


if __name__ == "__main__":
    main()
