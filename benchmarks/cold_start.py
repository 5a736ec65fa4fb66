"""How long a fresh process takes until its first pose, and an empty cache until all is compiled.

    python benchmarks/cold_start.py [--runs 5] [--no-compile] [--kernels 15]

Every number comes from processes of its own. The first table: machine code on disk; with Python's
bytecode kept on disk as usual, and without (PYTHONDONTWRITEBYTECODE). The second: ``scanlock
warmup`` into an empty folder on one core and on all. The third: CPU time of compiling, one process,
by kernel, and what Numba compiles of its own for each.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from scanlock.simulation import scan_pair
from tables import machine, print_table

FRESH = """
import sys, time
laps = [time.perf_counter()]
def lap():
    laps.append(time.perf_counter())
import numpy as np; lap()
import scanlock; lap()
import numba; lap()
scanlock.register; lap()
source, target = (np.load(name) for name in sys.argv[1:]); lap()
scanlock.register(source, target); lap()
scanlock.register(source, target); lap()
print(*np.diff(laps))
"""

STAGES = (
    "import numpy", "import scanlock", "import numba", "scanlock.register: SciPy and the rest",
    "(reading two scans)", "first registration", "second registration",
)  # fmt: skip

COMPILES = """
import sys, time
import scanlock
from numba.core import event

class Watch(event.Listener):
    def __init__(self):
        self.open = []
    def on_start(self, event):
        self.open.append([event.data["dispatcher"].py_func, time.process_time(), 0.0])
    def on_end(self, event):
        function, begin, inner = self.open.pop()
        seconds = time.process_time() - begin
        of = (self.open[0] if self.open else [function])[0]
        print(of.__module__ + "." + of.__qualname__, function.__module__, seconds - inner,
              file=sys.__stdout__)
        if self.open:
            self.open[-1][2] += seconds

with event.install_listener("numba:compile", Watch()):
    from scanlock.cli.commands.warm_up import warm_up
    import contextlib, io, os
    os.sched_setaffinity(0, [0])  # one process
    with contextlib.redirect_stdout(io.StringIO()):
        warm_up()
"""

WARM_UP = "from scanlock.cli import main; main(['warmup'])"


def output(code: str, *arguments: str, cores: int | None = None, **environment: str) -> str:
    """Return what a fresh process prints that runs some code."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("PYTHONDONT")}
    prefix = "" if cores is None else f"import os; os.sched_setaffinity(0, range({cores}));"
    return subprocess.run(
        [sys.executable, "-c", prefix + code, *arguments],
        env=inherited | environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def print_fresh(folder: Path, runs: int) -> None:
    pair = scan_pair("street", "hdl_64e", 0)
    names = [str(folder / "source.npy"), str(folder / "target.npy")]
    for name, cloud in zip(names, (pair.source, pair.target), strict=True):
        np.save(name, cloud.points)
    columns: list[list[float]] = []
    for unkept in ("", "1"):
        kept = str(folder / f"bytecode{unkept}")
        found: list[list[float]] = []
        for _ in range(runs + 1):
            text = output(FRESH, *names, PYTHONPYCACHEPREFIX=kept, PYTHONDONTWRITEBYTECODE=unkept)
            found.append([float(word) for word in text.split()])
        # The first run compiles what there is to compile.
        columns.append(list(np.median(found[1:], axis=0)))
    rows = [
        [stage, *(f"{1e3 * column[row]:.0f}" for column in columns)]
        for row, stage in enumerate(STAGES)
    ]
    imports = [sum(column[:4]) for column in columns]
    extra = [column[5] - column[6] for column in columns]
    rows.append(["all imports", *(f"{1e3 * one:.0f}" for one in imports)])
    rows.append(["first above second", *(f"{1e3 * one:.0f}" for one in extra)])
    print_table(("wall ms", "bytecode kept", "no bytecode"), rows)


def print_warm_ups(folder: Path) -> None:
    rows: list[list[str]] = []
    for cores in sorted({1, os.cpu_count() or 1}):
        empty = folder / f"kernels{cores}"
        empty.mkdir()
        said = output(WARM_UP, cores=cores, NUMBA_CACHE_DIR=str(empty))
        again = output(WARM_UP, cores=cores, NUMBA_CACHE_DIR=str(empty))
        rows.append([str(cores), said.splitlines()[0], again.splitlines()[0]])
    print_table(("cores", "scanlock warmup", "once more"), rows)


def print_kernels(folder: Path, count: int) -> None:
    empty = folder / "kernels"
    empty.mkdir()
    own: dict[str, float] = defaultdict(float)
    numbas: dict[str, float] = defaultdict(float)
    text = output(COMPILES, NUMBA_CACHE_DIR=str(empty))
    for line in text.splitlines():
        kernel, module, seconds = line.split()
        (own if module.startswith("scanlock") else numbas)[kernel] += float(seconds)
    order = sorted({*own, *numbas}, key=lambda one: -own[one] - numbas[one])
    shown, others = order[:count], order[count:]
    rows = [[one.split(".", 2)[2], f"{own[one]:.2f}", f"{numbas[one]:.2f}"] for one in shown]
    rest = [sum(table[one] for one in others) for table in (own, numbas)]
    rows.append([f"{len(others)} others", *(f"{one:.2f}" for one in rest)])
    rows.append(["all", *(f"{sum(table.values()):.2f}" for table in (own, numbas))])
    print_table(("kernel, with what it calls", "CPU s", "of Numba's own functions"), rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=5, help="processes a column")
    parser.add_argument("--no-compile", action="store_true", help="the first table only")
    parser.add_argument("--kernels", type=int, default=15, help="rows of the third table")
    arguments = parser.parse_args()
    cores = os.cpu_count() or 1
    print(machine(f"{cores} cores"), "\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print_fresh(folder, arguments.runs)
        if not arguments.no_compile:
            print()
            print_warm_ups(folder)
            print()
            print_kernels(folder, arguments.kernels)


if __name__ == "__main__":
    main()
