"""Commands interrupted at random moments: what they leave behind must be whole.

    python benchmarks/interrupts.py [--rounds 30] [--seed 0]

Each command that writes files runs over and over on small scans, every other time onto old files
where it replaces them, and at a random moment is sent SIGINT (Ctrl-C), SIGTERM (a request to end)
or SIGKILL. Its reader must then take every file that is there. There must be no word on stderr, and
no temporary file but that of a process that was killed. Runs are copies of one process in which all
is loaded and compiled, so that moments fall on work. Ends with an error where something is amiss;
needs a system that can fork.
"""

import argparse
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

from scanlock import io
from scanlock.cli import main as scanlock
from tables import machine, print_table

_CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -9}

_THINNING = 8
"""Of the simulated scans every so many-th point is left, so that runs are short and many."""

_FIRST = 1e-3
"""The earliest moment [s]: what comes before the command line is not its own."""

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
"""By how the names end."""

_ENDS = {
    ".png": b"IEND\xaeB`\x82",
    ".svg": b"</svg>\n",
    ".csv": b"\n",
    ".json": b"}\n",
}
"""How whole files end that scanlock has no reader for."""


def interrupted(command: str, number: int, delay: float) -> int:
    """Run a command in a copy of this process, send it a signal, and return its exit code."""
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


def harm(number: int) -> list[str]:
    """Return what a run did wrong that was sent a signal."""
    was_killed = number == signal.SIGKILL
    found = Path("stderr").read_text().splitlines()[-1:]
    for path in sorted(Path("out").rglob("*")):
        if path.name.endswith(".part"):
            found += [] if was_killed else [f"{path.name} is left"]
        elif path.is_file():
            try:
                read(path)
            except ValueError as error:
                found.append(f"{path.name}: {error}")
    return found


def read(path: Path) -> None:
    for end, reader in _READERS.items():
        if path.name.endswith(end):
            reader(path)
            return
    if not path.read_bytes().endswith(_ENDS[path.suffix]):
        raise ValueError("it is cut short")


def whole_run(command: str, kept: str) -> tuple[int, float]:
    """Run a command in this process, keep its files; return its exit code and how long it took."""
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
        scanlock(command.split())
        shutil.rmtree("out")
        begin = time.perf_counter()
        code = scanlock(command.split())
        seconds = time.perf_counter() - begin
    shutil.move("out", kept)
    return code, seconds


def make_drive() -> None:
    command = "simulate street -o out --sensor hdl-32e --scans 3 --every 5"
    whole_run(command, "whole")
    Path("drive").mkdir()
    for number, path in enumerate(sorted(Path("whole", "scans").iterdir())):
        io.write_scan(Path("drive", f"{number}.npy"), io.read_scan(path).points[::_THINNING])


def sweep(
    name: str, whole: int, number: signal.Signals, delays: Sequence[float]
) -> tuple[int, Counter[str]]:
    """Return how many runs a signal met, and what was wrong with any; `whole` ones exit so."""
    met = 0
    found: Counter[str] = Counter()
    for k, delay in enumerate(delays):
        if name in _REPLACING and k % 2:
            shutil.copytree(f"old-{name}", "out")
        code = interrupted(_COMMANDS[name], number, delay)
        if code != whole:
            met += 1
            found.update([] if code == _CODES[number] else [f"exit code {code}"])
        found.update(harm(number))
        shutil.rmtree("out", ignore_errors=True)
    return met, found


def rows(rounds: int, rng: np.random.Generator, total: Counter[str]) -> Iterator[Sequence[str]]:
    for name, command in _COMMANDS.items():
        whole, seconds = whole_run(command, f"old-{name}")
        for number, code in _CODES.items():
            delays = rng.uniform(_FIRST, seconds, rounds)
            met, found = sweep(name, whole, number, delays.tolist())
            total.update(found)
            said = "; ".join(f"{count} x {what}" for what, count in found.items())
            yield name, f"{number.name}, {code}", f"{rounds}", f"{met}", said or "none"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--rounds", type=int, default=30, help="of each command and signal")
    parser.add_argument("--seed", type=int, default=0, help="decides the moments")
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    total: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder, chdir(folder):
        make_drive()
        header = ("command", "signal, exit code", "runs", "interrupted", "harm")
        print_table(header, rows(arguments.rounds, rng, total))
    print(f"\n{machine()}")
    return 1 if total else 0


if __name__ == "__main__":
    sys.exit(main())
