"""Time of a fresh process until its first pose, and of compiling all kernels into an empty cache.

    python -m benchmarks.speed.cold_start [--runs 5] [--no-compile] [--kernels 15]

Every number is measured in new processes. First table: start with machine code on disk, with
Python's bytecode on disk as usual and without (PYTHONDONTWRITEBYTECODE). Second table: ``scanlock
warmup`` into an empty folder, on one core and on all. Third table: CPU time of compilation in one
process, by kernel, with the share of Numba's own functions.
"""

import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock.simulation import scan_pair

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
scanlock.register(source=source, target=target); lap()
scanlock.register(source=source, target=target); lap()
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
    """Return the standard output of a fresh process that runs some code."""
    inherited = {k: v for k, v in os.environ.items() if not k.startswith("PYTHONDONT")}
    prefix = "" if cores is None else f"import os; os.sched_setaffinity(0, range({cores}));"
    return subprocess.run(
        [sys.executable, "-c", prefix + code, *arguments],
        env=inherited | environment,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def fresh_rows(folder: Path, runs: int) -> list[list[str]]:
    """Return the rows of the first table."""
    pair = scan_pair("street", "hdl_64e", 0)
    names = [str(folder / "source.npy"), str(folder / "target.npy")]
    for name, cloud in zip(names, (pair.source, pair.target), strict=True):
        np.save(name, cloud.points)
    columns: list[list[float]] = []
    for no_bytecode in ("", "1"):
        cache = str(folder / f"bytecode{no_bytecode}")
        found: list[list[float]] = []
        for _ in range(runs + 1):
            text = output(
                FRESH, *names, PYTHONPYCACHEPREFIX=cache, PYTHONDONTWRITEBYTECODE=no_bytecode
            )
            found.append([float(word) for word in text.split()])
        # The first run compiles.
        columns.append(list(np.median(found[1:], axis=0)))
    rows = [
        [stage, *(f"{1e3 * column[row]:.0f}" for column in columns)]
        for row, stage in enumerate(STAGES)
    ]
    imports = [sum(column[:4]) for column in columns]
    extra = [column[5] - column[6] for column in columns]
    rows.append(["all imports", *(f"{1e3 * one:.0f}" for one in imports)])
    rows.append(["first minus second", *(f"{1e3 * one:.0f}" for one in extra)])
    return rows


def warm_up_rows(folder: Path) -> list[list[str]]:
    """Return the rows of the second table."""
    rows: list[list[str]] = []
    for cores in sorted({1, os.cpu_count() or 1}):
        empty = folder / f"kernels{cores}"
        empty.mkdir()
        first = output(WARM_UP, cores=cores, NUMBA_CACHE_DIR=str(empty))
        second = output(WARM_UP, cores=cores, NUMBA_CACHE_DIR=str(empty))
        rows.append([str(cores), first.splitlines()[0], second.splitlines()[0]])
    return rows


def kernel_rows(folder: Path, count: int) -> list[list[str]]:
    """Return the rows of the third table."""
    empty = folder / "kernels"
    empty.mkdir()
    own: dict[str, float] = defaultdict(float)
    of_numba: dict[str, float] = defaultdict(float)
    text = output(COMPILES, NUMBA_CACHE_DIR=str(empty))
    for line in text.splitlines():
        kernel, module, seconds = line.split()
        (own if module.startswith("scanlock") else of_numba)[kernel] += float(seconds)
    order = sorted({*own, *of_numba}, key=lambda one: -own[one] - of_numba[one])
    shown, others = order[:count], order[count:]
    rows = [[one.split(".", 2)[2], f"{own[one]:.2f}", f"{of_numba[one]:.2f}"] for one in shown]
    rest = [sum(table[one] for one in others) for table in (own, of_numba)]
    rows.append([f"{len(others)} others", *(f"{one:.2f}" for one in rest)])
    rows.append(["all", *(f"{sum(table.values()):.2f}" for table in (own, of_numba))])
    return rows


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--runs", type=int, default=5, help="processes per column")
    parser.add_argument("--no-compile", action="store_true", help="the first table only")
    parser.add_argument("--kernels", type=int, default=15, help="rows of the third table")
    arguments = parser.parse_args()
    cores = os.cpu_count() or 1
    results = Results(arguments.json, f"{cores} cores")
    results.print_machine()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        columns = ("wall ms", "with bytecode", "without bytecode")
        results.add_table(columns, fresh_rows(folder, arguments.runs), title="fresh process")
        if not arguments.no_compile:
            columns = ("cores", "scanlock warmup", "second run")
            results.add_table(columns, warm_up_rows(folder), title="empty cache")
            columns = ("kernel and its callees", "CPU s", "CPU s of Numba's own functions")
            rows = kernel_rows(folder, arguments.kernels)
            results.add_table(columns, rows, title="compilation by kernel")


if __name__ == "__main__":
    main()
