"""Commands interrupted at random moments: every remaining file must be complete.

    python -m benchmarks.io.interrupts [--rounds 30] [--seed 0]

Each command that writes files runs repeatedly on small scans, every second time over old files
where it replaces them. At a random moment it gets SIGINT (Ctrl-C), SIGTERM or SIGKILL. Afterwards
every file must be readable, stderr must be empty, and only a killed process may leave a temporary
file. Runs are forks of one process with compiled kernels, so that signals arrive during the work.
The exit code is 1 after a violation. Needs a system with fork.
"""

import os
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import chdir, redirect_stdout
from pathlib import Path

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock import io
from scanlock.cli import main as scanlock

_CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}

_STRIDE = 8
"""Every eighth point of the simulated scans remains, so that runs are short."""

_MIN_DELAY = 1e-3
"""Minimum delay of a signal [s], so that the command line has started."""

_COMMANDS = {
    "register": "register drive/0.npy drive/1.npy -o out/pose.txt --picture out/pair.png",
    "segment": "segment drive/0.npy -o out/labels.npy --picture out/scan.svg",
    "map": "map drive -o out",
    "simulate": "simulate forest -o out --sensor hdl-32e --scans 3 --format ply",
}

_REPLACING = ("register", "segment")

_READERS: dict[str, Callable[[Path], object]] = {
    "pose.txt": io.read_pose,
    "_kitti.txt": io.read_kitti_poses,
    "_tum.txt": io.read_tum_poses,
    ".npy": io.read_labels,
    ".ply": io.read_scan,
}
"""Readers by the end of the file name."""

_ENDS = {
    ".png": b"IEND\xaeB`\x82",
    ".svg": b"</svg>\n",
    ".csv": b"\n",
    ".json": b"}\n",
}
"""Last bytes of complete files without a reader in scanlock."""


def interrupted(command: str, number: int, delay: float) -> int:
    """Run a command in a fork of this process, send it a signal, and return its exit code."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        code = 99
        try:
            with open("stdout", "w") as sys.stdout, open("stderr", "w") as sys.stderr:
                try:
                    os.write(writing, b"begun")
                    code = scanlock(command.split())
                except BaseException:
                    traceback.print_exc()
        finally:
            os._exit(code)
    os.read(reading, 1)
    os.close(reading)
    os.close(writing)
    time.sleep(delay)
    os.kill(child, number)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status)


def violations(number: int) -> list[str]:
    """Return the violations of an interrupted run."""
    was_killed = number == signal.SIGKILL
    found = Path("stderr").read_text().splitlines()[-1:]
    for path in sorted(Path("out").rglob("*")):
        if path.name.endswith(".part"):
            found += [] if was_killed else [f"{path.name} remains"]
        elif path.is_file():
            try:
                read(path)
            except ValueError as error:
                found.append(f"{path.name}: {error}")
    return found


def read(path: Path) -> None:
    """Read a file; raise a ValueError where it is incomplete."""
    for end, reader in _READERS.items():
        if path.name.endswith(end):
            reader(path)
            return
    if not path.read_bytes().endswith(_ENDS[path.suffix]):
        raise ValueError("incomplete")


def complete_run(command: str, folder: str) -> tuple[int, float]:
    """Run a command, move its files to a folder, and return exit code and duration [s]."""
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        scanlock(command.split())
        shutil.rmtree("out")
        begin = time.perf_counter()
        code = scanlock(command.split())
        seconds = time.perf_counter() - begin
    shutil.move("out", folder)
    return code, seconds


def make_drive() -> None:
    """Write the scans that the commands read."""
    command = "simulate street -o out --sensor hdl-32e --scans 3 --every 5"
    complete_run(command, "complete")
    Path("drive").mkdir()
    for number, path in enumerate(sorted(Path("complete", "scans").iterdir())):
        io.write_scan(Path("drive", f"{number}.npy"), io.read_scan(path).points[::_STRIDE])


def sweep(
    name: str, complete: int, number: signal.Signals, delays: Sequence[float]
) -> tuple[int, Counter[str]]:
    """Return the number of interrupted runs, and the violations.

    `complete` is the exit code of a run that finished before its signal.
    """
    interruptions = 0
    found: Counter[str] = Counter()
    for k, delay in enumerate(delays):
        if name in _REPLACING and k % 2:
            shutil.copytree(f"old-{name}", "out")
        code = interrupted(_COMMANDS[name], number, delay)
        if code != complete:
            interruptions += 1
            found.update([] if code == _CODES[number] else [f"exit code {code}"])
        found.update(violations(number))
        shutil.rmtree("out", ignore_errors=True)
    return interruptions, found


def rows(rounds: int, rng: np.random.Generator, total: Counter[str]) -> Iterator[Sequence[str]]:
    """Yield one row per command and signal."""
    for name, command in _COMMANDS.items():
        complete, seconds = complete_run(command, f"old-{name}")
        for number, code in _CODES.items():
            delays = rng.uniform(_MIN_DELAY, seconds, rounds)
            interruptions, found = sweep(name, complete, number, delays.tolist())
            total.update(found)
            text = "; ".join(f"{count} x {kind}" for kind, count in found.items())
            yield name, f"{number.name}, {code}", f"{rounds}", f"{interruptions}", text or "none"


def main() -> int:
    parser = make_parser(__doc__)
    parser.add_argument("--rounds", type=int, default=30, help="runs per command and signal")
    parser.add_argument("--seed", type=int, default=0, help="seed of the moments")
    arguments = parser.parse_args()
    if arguments.json is not None:
        arguments.json = arguments.json.resolve()
    results = Results(arguments.json)
    rng = np.random.default_rng(arguments.seed)
    total: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        make_drive()
        columns = ("command", "signal, exit code", "runs", "interrupted", "violations")
        results.add_table(columns, rows(arguments.rounds, rng, total), title="interrupts")
    print(f"\n{results.machine_line}")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
