"""Results of a benchmark: tables on the screen and, with ``--json``, in a file."""

import json
import os
import platform
import shlex
import subprocess
import sys
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numba
import numpy as np

from benchmarks._common.arguments import program_name

_ROOT = Path(__file__).resolve().parents[2]


class Results:
    """Tables of one run, printed row by row and written to a file after each table.

    Parameters
    ----------
    path : Path, optional
        JSON file to write; none by default.
    load : str
        Number of threads, for the line about the machine.

    Notes
    -----
    The file holds ``command``, ``commit``, ``dirty`` (uncommitted changes to tracked files),
    ``machine``, ``date`` and ``tables``, a list of ``title``, ``columns`` and ``rows``. Cells are
    the printed texts. The command holds ``FOLDER`` for the data and no absolute path.
    """

    def __init__(self, path: Path | None = None, load: str = "one thread") -> None:
        self._path = path
        self._load = load
        commit = _git("rev-parse", "--short", "HEAD")
        self._contents: dict[str, Any] = {
            "command": command_line(sys.argv[1:]),
            "commit": commit,
            "dirty": None if commit is None else bool(_git("status", "--porcelain", "-uno")),
            "machine": machine(),
            "date": datetime.now(UTC).isoformat(timespec="seconds"),
            "tables": [],
        }

    @property
    def machine_line(self) -> str:
        """The machine and the versions, for the head of the output."""
        found = self._contents["machine"]
        versions = f"Python {found['python']}, NumPy {found['numpy']}, Numba {found['numba']}"
        return f"{found['processor']}, {self._load}; {versions}"

    def print_machine(self) -> None:
        """Print the machine and the versions, followed by an empty line."""
        print(f"{self.machine_line}\n", flush=True)

    def add_table(
        self,
        columns: Sequence[str],
        rows: Iterable[Sequence[str]],
        *,
        title: str = "",
        note: str = "",
    ) -> None:
        """Print a table as its rows arrive, and write the file.

        Parameters
        ----------
        columns : sequence of str
        rows : iterable of sequence of str
            Cells as they are printed; may be a generator that measures.
        title : str
            Heading, and the name of the table in the file.
        note : str
            Sentence between heading and table.
        """
        if title:
            print(f"\n### {title}\n")
        if note:
            print(f"{note}\n")
        print("| " + " | ".join(columns) + " |")
        print("|" + " --- |" * len(columns))
        cells: list[list[str]] = []
        for row in rows:
            print("| " + " | ".join(row) + " |", flush=True)
            cells.append(list(row))
        table = {"title": title, "columns": list(columns), "rows": cells}
        self._contents["tables"].append(table)
        if self._path is not None:
            self._path.write_text(to_json(self._contents), encoding="utf-8")


def machine() -> dict[str, Any]:
    """Return the processor, the number of cores, and the versions that decide speed."""
    processor = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        names = [line for line in info.read_text().splitlines() if line.startswith("model name")]
        if names:
            processor = names[0].split(":", 1)[1].strip()
    return {
        "processor": processor,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


def command_line(arguments: Sequence[str]) -> str:
    """Return the command without ``--json`` and without paths of this machine."""
    words = [word for one in arguments for word in (one.split("=", 1) if "=" in one else [one])]
    shown: list[str] = []
    for previous, word in zip(["", *words], words, strict=False):
        if "--json" in (previous, word):
            continue
        path = Path(word)
        shown.append(
            "FOLDER" if previous == "--data" else path.name if path.is_absolute() else word
        )
    return " ".join([program_name(), *map(shlex.quote, shown)])


def to_json(contents: dict[str, Any]) -> str:
    """Return the contents of a results file as JSON with one row of a table per line."""
    head = {name: value for name, value in contents.items() if name != "tables"}
    tables = ",\n".join(_table_text(table) for table in contents["tables"])
    return f"{json.dumps(head, indent=2, ensure_ascii=False)[:-2]},\n" + (
        f'  "tables": [\n{tables}\n  ]\n}}\n'
    )


def _table_text(table: dict[str, Any]) -> str:
    title, columns = (json.dumps(table[key], ensure_ascii=False) for key in ("title", "columns"))
    rows = ",\n".join(f"        {json.dumps(row, ensure_ascii=False)}" for row in table["rows"])
    return (
        f'    {{\n      "title": {title},\n      "columns": {columns},\n'
        f'      "rows": [\n{rows}\n      ]\n    }}'
    )


def _git(*arguments: str) -> str | None:
    try:
        done = subprocess.run(
            ["git", "-C", str(_ROOT), *arguments], capture_output=True, text=True, check=True
        )
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()
