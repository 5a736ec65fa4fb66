"""Covariances of real scans split by rings, blocks of azimuth, shells of range, or points.

    python -m benchmarks.uncertainty.real_splits --data FOLDER [--methods auto ndt] [--every 1]
        [--splits points rings blocks wide-blocks shells]

Each of 65 scans of some twenty sensors is split into two disjoint halves, of which one is moved by
up to 1 m and 10 degrees. The motion is the exact pose. Methods start about 0.35 m and 1 degree from
it.

- ``points``: at random. Both halves share rings, blocks and surfaces, so errors common to these
  cancel.
- ``rings``: alternate bands of elevation, one, two and three beams wide.
- ``blocks``: alternate blocks of azimuth, 1 to 2 and 2 to 4 degrees wide. The widths are random.
- ``wide-blocks``: the same, 6 to 12 degrees wide. ``shells``: alternate shells of range, each 15 %
  farther than the last. The halves share no surface, and correct poses are rarely verified.

NEES is the normalised estimation error squared of the covariance, 6 if it is calibrated. Columns
are over poses with status ok; "NEES of all" includes the others, except lost ones: errors above
0.5 m, or no covariance.
"""

import zlib
from collections.abc import Iterable
from itertools import groupby

import numpy as np
from scipy.stats import chi2

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from benchmarks._common.scan_splits import (
    Split,
    by_azimuth,
    by_points,
    by_range,
    by_rings,
    measured,
    with_motion,
)
from benchmarks._common.sensors import RealScan, real_scans_of_many_sensors
from benchmarks.uncertainty.covariance import KINDS, Error, error_of, near
from scanlock.registration.prepare import prepare

METHODS = ("auto", "ndt", "gicp", "sgc-ndt-d2d")
SPLITS = ("points", "rings", "blocks", "wide-blocks", "shells")
COLUMNS = (
    "split", "method", "scans", "halves", "lost", "not ok", "mean NEES (6)", "median",
    "within 99 %", "largest", "NEES of all", "predicted deviation", "error",
)  # fmt: skip


def splits_of(scan: RealScan, name: str) -> dict[str, Split]:
    """Return the splits of a kind by their titles."""
    beam = scan.beam_spacing
    kinds: dict[str, dict[str, Split]] = {
        "points": {"points": by_points},
        "rings": {f"rings, {n} beams": by_rings(n * beam) for n in (1, 2, 3)},
        "blocks": {f"blocks, {n} to {2 * n}°": by_azimuth(float(n)) for n in (1, 2)},
        "wide-blocks": {"blocks, 6 to 12°": by_azimuth(6.0)},
        "shells": {"shells": by_range(1.15)},
    }
    return kinds[name]


class Trials:
    """Errors of all trials, with the split, the method and the scan of each."""

    def __init__(self, methods: Iterable[str]) -> None:
        self.methods = tuple(methods)
        self.found: list[tuple[str, str, str, RealScan, Error | None]] = []

    def run(self, scan: RealScan, kind: str) -> None:
        """Register the halves of one scan by all splits of a kind."""
        points = measured(scan.load())
        for title, split in splits_of(scan, kind).items():
            seed = zlib.crc32(f"{scan.sensor}, {scan.name}, {title}".encode())
            rng = np.random.default_rng(seed)
            target, source, truth = with_motion(points, split(points, rng), rng)
            start = near(truth, rng)
            for name in self.methods:
                of_source, of_target = (
                    prepare(half, method=KINDS[name]) for half in (source, target)
                )
                error = error_of("sandwich", of_source, of_target, truth, start)
                self.found.append((kind, title, name, scan, error))

    def rows(self, kinds: Iterable[str]) -> Iterable[tuple[str, ...]]:
        """Yield the rows of each kind as a whole, then those of its splits."""
        for kind in kinds:
            titles = {one[1]: None for one in self.found if one[0] == kind}
            for name in self.methods:
                yield row(kind, name, [one for one in self.found if one[::2][:2] == (kind, name)])
            for title in titles if len(titles) > 1 else ():
                for name in self.methods:
                    yield row(title, name, [one for one in self.found if one[1:3] == (title, name)])

    def rows_by_sensor(self) -> Iterable[tuple[str, ...]]:
        """Yield the rows of rings and blocks together for each sensor."""
        chosen = [one for one in self.found if one[0] in ("rings", "blocks")]
        for sensor, group in groupby(chosen, key=lambda one: one[3].sensor):
            found = list(group)
            for name in self.methods:
                yield row(sensor, name, [one for one in found if one[2] == name])


def row(
    title: str, name: str, found: list[tuple[str, str, str, RealScan, Error | None]]
) -> tuple[str, ...]:
    """Return the cells of `COLUMNS`."""
    errors = [one[4] for one in found if one[4] is not None]
    accepted = [one for one in errors if one.is_ok]
    scans = len({(one[3].sensor, one[3].name) for one in found})
    counts = (scans, len(found), len(found) - len(errors), len(errors) - len(accepted))
    head = (title, name, *map(str, counts))
    if not accepted:
        return (*head, *["-"] * (len(COLUMNS) - len(head)))
    nees = np.array([one.nees for one in accepted])
    return (
        *head,
        f"{nees.mean():.1f}",
        f"{np.median(nees):.1f}",
        f"{np.mean(nees < chi2.ppf(0.99, 6)):.0%}",
        f"{nees.max():.0f}",
        f"{np.mean([one.nees for one in errors]):.1f}",
        f"{1e3 * np.median([one.predicted for one in accepted]):.1f} mm",
        f"{1e3 * np.median([one.actual for one in accepted]):.1f} mm",
    )


def main() -> None:
    parser = make_parser(__doc__, data=True)
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=list(KINDS))
    parser.add_argument("--splits", nargs="*", default=list(SPLITS), choices=SPLITS)
    parser.add_argument("--every", type=int, default=1, help="use every n-th scan")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    results.print_machine()
    trials = Trials(arguments.methods)
    for scan in list(real_scans_of_many_sensors(arguments.data))[:: arguments.every]:
        for kind in arguments.splits:
            trials.run(scan, kind)
    results.add_table(COLUMNS, trials.rows(arguments.splits), title="by split")
    results.add_table(
        ("sensor", *COLUMNS[1:]), trials.rows_by_sensor(), title="rings and blocks by sensor"
    )


if __name__ == "__main__":
    main()
