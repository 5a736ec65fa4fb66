"""Tables of docs/benchmarks.md, written from the files in benchmarks/results.

    python -m benchmarks.report benchmarks/results [--page docs/benchmarks.md]

A benchmark writes such a file with ``--json``. The page marks the place of each table by two
comments, ``<!-- table: NAME -->`` and ``<!-- end of table -->``; everything else is left as it is.
"""

import argparse
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean
from typing import Any

_PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks.md"

_MARKED = re.compile(r"(<!-- table: (\S+) -->\n).*?(<!-- end of table -->)", re.DOTALL)


@dataclass(frozen=True)
class Table:
    """A printed table: columns, and rows of as many cells."""

    columns: Sequence[str]
    rows: Sequence[Sequence[str]]

    def column(self, name: str) -> int:
        """Return the index of a column."""
        return list(self.columns).index(name)

    def row(self, first: str) -> Sequence[str]:
        """Return the row with a given first cell."""
        return next(row for row in self.rows if row[0] == first)

    def to_markdown(self) -> str:
        """Return the table in Markdown, numbers to the right."""
        rule = [":---", *["---:"] * (len(self.columns) - 1)]
        return "\n".join(f"| {' | '.join(row)} |" for row in (self.columns, rule, *self.rows))


class File:
    """One file of results."""

    def __init__(self, path: Path) -> None:
        self.contents: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))

    def table(self, title: str) -> Table:
        """Return the table with a title."""
        found = next(one for one in self.contents["tables"] if one["title"] == title)
        return Table(found["columns"], found["rows"])

    def source(self) -> str:
        """Return the sentence that names command, machine, commit and date."""
        machine = self.contents["machine"]
        names = {"python": "Python", "numpy": "NumPy", "numba": "Numba"}
        facts = [machine["processor"]]
        facts += [f"{machine['cores']} cores"] if machine["cores"] else []
        facts += [f"{name} {machine[key]}" for key, name in names.items() if machine[key]]
        verb = "recorded in " if self.contents.get("transcribed") else ""
        changes = " with changes" if self.contents["dirty"] else ""
        commit = f"{verb}commit {self.contents['commit']}{changes}"
        note = self.contents.get("note", "")
        return (
            f"`{self.contents['command']}`; {', '.join(facts)}; {commit}, "
            f"{self.contents['date'][:10]}.{f' {note}' if note else ''}"
        )


_DATA_SETS = {
    "KITTI drive 0005, 5 to 20 scans apart": ("kitti_drive_0005, 5 ", "kitti_drive_0005, 10 ",
                                              "kitti_drive_0005, 20 "),
    "KITTI drive 0005, 30 to 55 scans apart": ("kitti_drive_0005, 30 ", "kitti_drive_0005, 45 ",
                                               "kitti_drive_0005, 55 "),
    "KITTI odometry 00, 1 to 15 scans apart": ("kitti_00",),
    "handheld, 1 to 10 scans apart": ("handheld_balm",),
    "Newer College, 1 to 4 scans apart": ("newer_01",),
    "forest, campus, city, car park, off road": ("forest_os1", "hdl32_pair", "av2_pair",
                                                 "car_cloud_pair", "rellis_offroad"),
    "indoor corridor": ("terrestrial_3dtk",),
}  # fmt: skip


def any_start(file: File) -> Table:
    """Return solved trials by data set."""
    table = file.table("solved")
    rows = [
        [
            name,
            *(
                _summed([row[at] for row in table.rows if row[0].startswith(groups)])
                for at in range(1, len(table.columns))
            ),
        ]
        for name, groups in _DATA_SETS.items()
        if any(row[0].startswith(groups) for row in table.rows)
    ]
    return Table(table.columns, rows)


def basin(file: File) -> Table:
    """Return solved starts by level, and the wrong poses with status ok of all levels."""
    table = file.table("basin")
    rows: list[list[str]] = []
    for name, *cells in table.rows:
        found = [re.fullmatch(r"(\d+ / \d+) \(\d+ ms, (\d+)\)", cell) for cell in cells]
        levels = [(match[1], int(match[2])) for match in found if match]
        rows.append([name, *(solved for solved, _ in levels), str(sum(n for _, n in levels))])
    return Table([*table.columns, "wrong, called ok"], rows)


_FAMILIES = {
    "outdoors, vehicle": ("city, 10 apart", "city, 20 apart", "kitti_00", "other outdoors"),
    "handheld, 1 and 3 apart": ("handheld, 1", "handheld, 3"),
    "handheld, 6 and 10 apart": ("handheld, 6", "handheld, 10"),
    "corridor": ("corridor",),
}


def real_pairs(file: File) -> Table:
    """Return solved pairs by family, and the errors on the city drive."""
    solved, city = file.table("solved"), file.table("kitti_drive_0005, 10 apart")
    rows: list[list[str]] = []
    for row in solved.rows:
        cells = [
            _summed([row[solved.column(family)] for family in families])
            for families in _FAMILIES.values()
        ]
        errors = city.row(row[0])
        rows.append(
            [
                row[0],
                *cells,
                row[solved.column("wrong, called ok")],
                *(errors[city.column(name)] for name in ("median", "95th percentile")),
            ]
        )
    columns = ["method", *_FAMILIES, "wrong, called ok", "city: median", "city: 95th percentile"]
    return Table(columns, rows)


def failure_detection(file: File) -> Table:
    """Return the rows over all trials, of scanlock and of the other libraries."""
    table = file.table("failure detection")
    libraries = ("small_gicp", "Open3D", "KISS-Matcher")
    return Table(
        table.columns, [row for row in table.rows if row[0].startswith(("all,", *libraries))]
    )


_CLOUDS = {
    "RELLIS-3D, off road": ("RELLIS",),
    "Argoverse 2, city": ("AV2",),
    "forest, OS1": ("forest moving", "forest still"),
    "airborne, MixedConifer": ("airborne MixedConifer",),
    "airborne, Topography": ("airborne Topography",),
    "airborne, autzen_trim": ("airborne autzen_trim",),
    "simulated street": ("street ",),
    "simulated forest": ("forest hdl",),
    "simulated rugged ground": ("rugged ",),
}


def ground(file: File) -> Table:
    """Return the mean F1 by kind of cloud, and the label agreement of pairs of scans."""
    table, agreement = file.table("ground"), file.table("agreement")
    method, score = table.column("method"), table.column("F1")
    methods = list(dict.fromkeys(row[method] for row in table.rows))
    rows: list[list[str]] = []
    for name, clouds in _CLOUDS.items():
        scores = {
            one: [
                float(row[score])
                for row in table.rows
                if row[0].startswith(clouds) and row[method] == one
            ]
            for one in methods
        }
        count = len(scores[methods[0]])
        if count:
            rows.append([name, str(count), *(f"{fmean(scores[one]):.3f}" for one in methods)])
    ratios = [agreement.row(one)[agreement.column("all points")] for one in methods]
    rows.append(["agreement of two scans, KITTI drive 0005", "-", *(ratio[:5] for ratio in ratios)])
    return Table(["F1", "clouds", *methods], rows)


SECTIONS: dict[str, Callable[[File], Table]] = {
    "any_start": any_start,
    "any_rotation": any_start,
    "basin": basin,
    "real_pairs": real_pairs,
    "split_scans": lambda file: file.table("all scans"),
    "airborne": lambda file: file.table("all tiles"),
    "speed": lambda file: file.table("summary, city"),
    "failure_detection": failure_detection,
    "ground": ground,
}
"""Tables of the page by name; the file of results has the same name."""


def _summed(cells: Sequence[str]) -> str:
    """Return the sum of cells such as "3 / 5"."""
    pairs = [cell.split(" / ") for cell in cells]
    return f"{sum(int(n) for n, _ in pairs):,} / {sum(int(of) for _, of in pairs):,}"


def updated(page: str, folder: Path) -> str:
    """Return a page with its tables written from the files of a folder."""

    def replaced(match: re.Match[str]) -> str:
        file = File(folder / f"{match[2]}.json")
        table = SECTIONS[match[2]](file).to_markdown()
        return f"{match[1]}{table}\n\n{file.source()}\n{match[3]}"

    return _MARKED.sub(replaced, page)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="folder of the results files")
    parser.add_argument("--page", type=Path, default=_PAGE, help="Markdown file to update")
    arguments = parser.parse_args()
    text = arguments.page.read_text(encoding="utf-8")
    arguments.page.write_text(updated(text, arguments.folder), encoding="utf-8")


if __name__ == "__main__":
    main()
