"""Damaged files for every reader: no crash, no hang, no excess of memory, no lost points.

    python -m benchmarks.io.fuzz_readers [--inputs 1000000] [--seed 0] [--keep FOLDER]

Small files of every format are damaged: bits flipped, bytes removed, repeated, inserted and taken
from another file, numbers in headers replaced by huge, negative and malformed ones. A reader must
return or raise an error of scanlock, within a second and with at most 64 MiB plus 64 times the file
size. A truncated file must not be read as a smaller scan where the format states the number of
points. ``--keep`` collects the inputs that violate this, in one folder per reader; ``tests/corpus``
holds earlier ones. The memory limit needs Linux.
"""

import random
import re
import resource
import struct
import sys
import tempfile
import time
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks._common.arguments import make_parser
from benchmarks._common.results import Results
from scanlock.errors import ScanlockError
from scanlock.geometry.pose import Pose
from scanlock.io import (
    read_kitti_poses,
    read_labels,
    read_pose,
    read_scan,
    read_tum_poses,
    write_kitti_poses,
    write_labels,
    write_pose,
    write_scan,
    write_tum_poses,
)
from scanlock.registration.registry import METHODS
from scanlock.registration.settings.file import read_settings, write_settings

_MAX_SECONDS = 1.0
"""Maximum duration of reading a file of a few kilobytes [s]."""

_MAX_GROWTH = 64 * 2**20
"""Maximum growth of memory, in addition to 64 times the file size [bytes]."""

_HEADROOM = 2**30
"""Address space left to a reader [bytes]."""

_TOKENS = (
    b"0", b"-1", b"1", b"2", b"3", b"65536", b"2147483647", b"2147483648", b"4294967295",
    b"9223372036854775807", b"9223372036854775808", b"99999999999999999999", b"-9999999999",
    b"1e308", b"1e-320", b"nan", b"inf", b"-inf", b"0x10", b"1_000", b"", b" ", b"\n", b"\0", b"x",
    b"float", b"double", b"uchar", b"int64", b"list uchar int", b"binary_compressed", b"ascii",
    b"'O'", b"|O", b"True", b"()", b"(1,)", b"(0, 3)", b"(-1, 3)", b"(99999999999, 3)",
    b"\xff\xfe", b"\xef\xbb\xbf", b"end_header", b"DATA ascii", b"FIELDS x", b"property float x",
)  # fmt: skip

_WORD = re.compile(rb"[A-Za-z0-9_.+-]+")
_NUMBER = re.compile(rb"-?\d[\d.e+-]*")


@dataclass(frozen=True)
class Seed:
    """A valid file, its reader, and the number of points that the file states, or 0."""

    name: str
    data: bytes
    read: Callable[[Path], Any]
    stated: int = 0


@dataclass
class Tally:
    """Outcomes of the inputs of one kind of file."""

    outcomes: Counter[str] = field(default_factory=Counter)
    slowest: float = 0.0
    errors: Counter[str] = field(default_factory=Counter)


def seeds(folder: Path) -> Iterator[Seed]:
    """Yield one small file of every kind."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-30.0, 30.0, (12, 3)).astype(np.float32)
    fields = {"intensity": rng.random(12, np.float32), "ring": np.arange(12, dtype=np.uint8)}
    kinds = [
        ("a.pcd", "ascii", True), ("a.pcd", "binary", True), ("a.pcd", "compressed", True),
        ("a.ply", "ascii", True), ("a.ply", "binary", True), ("a.npy", None, True),
        ("a.npz", "binary", True), ("a.npz", "compressed", True), ("a.bin", None, False),
        ("a.txt", None, False), ("a.csv", None, False), ("a.pts", None, True),
        ("a.las", "binary", True), ("a.laz", "compressed", True), ("a.e57", None, True),
        ("a.ptx", None, True), ("a.vtk", "ascii", True), ("a.vtk", "binary", True),
        ("a.obj", None, False),
    ]  # fmt: skip
    for name, encoding, states_count in kinds:
        path = folder / name
        columns = {"intensity": fields["intensity"]} if name == "a.bin" else fields
        columns = {} if name.endswith((".npy", ".pts", ".las", ".laz", ".ptx", ".obj")) else columns
        write_scan(path, points, columns, encoding=encoding)
        label = f"{path.suffix[1:]} {encoding or ''}".strip()
        yield Seed(label, path.read_bytes(), read_scan, len(points) if states_count else 0)
    path = folder / "a.vtp"
    path.write_bytes(_vtp(points))
    yield Seed("vtp", path.read_bytes(), read_scan, len(points))
    poses = [Pose.from_step(rng.normal(size=6)) for _ in range(3)]
    for name, write, read in (
        ("pose.txt", lambda path: write_pose(path, poses[0]), read_pose),
        ("pose.npy", lambda path: write_pose(path, poses[0]), read_pose),
        ("kitti.txt", lambda path: write_kitti_poses(path, poses), read_kitti_poses),
        ("tum.txt", lambda path: write_tum_poses(path, [0.0, 1.0, 2.0], poses), read_tum_poses),
        ("a.label", lambda path: write_labels(path, np.arange(12)), read_labels),
        ("labels.npy", lambda path: write_labels(path, np.arange(12)), read_labels),
        ("labels.txt", lambda path: write_labels(path, np.arange(12)), read_labels),
        ("settings.toml", lambda path: write_settings(path, METHODS["icp"]), read_settings),
    ):
        path = folder / name
        write(path)
        yield Seed(name, path.read_bytes(), read)


def _vtp(points: np.ndarray) -> bytes:
    """Return points as polygonal data of VTK, compressed by zlib and appended as raw bytes."""
    raw = points.astype("<f4").tobytes()
    packed = zlib.compress(raw)
    head = struct.pack("<4I", 1, len(raw), 0, len(packed))
    text = (
        '<VTKFile type="PolyData" byte_order="LittleEndian" header_type="UInt32" '
        'compressor="vtkZLibDataCompressor"><PolyData>'
        f'<Piece NumberOfPoints="{len(points)}"><Points><DataArray type="Float32" '
        'NumberOfComponents="3" format="appended" offset="0"/></Points></Piece></PolyData>'
        '<AppendedData encoding="raw">_'
    )
    return text.encode() + head + packed + b"</AppendedData></VTKFile>"


def damaged(data: bytes, other: bytes, rng: random.Random) -> tuple[bytes, bool]:
    """Return a damaged file, and whether it was only truncated."""
    if rng.random() < 0.15:
        return data[: rng.randrange(len(data))], True
    for _ in range(rng.choice((1, 1, 1, 2, 2, 4))):
        data = rng.choice(_FAULTS)(data, other, rng) or data
    return data, False


def _flip(data: bytes, other: bytes, rng: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8))):
        changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def _overwrite(data: bytes, other: bytes, rng: random.Random) -> bytes:
    changed, at = bytearray(data), rng.randrange(len(data))
    width = rng.choice((1, 2, 4, 8))
    value = rng.choice(
        (0, 1, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1, rng.getrandbits(64))
    )
    changed[at : at + width] = (value % 2 ** (8 * width)).to_bytes(
        width, rng.choice(("little", "big"))
    )
    return bytes(changed)


def _token(data: bytes, other: bytes, rng: random.Random) -> bytes:
    words = list((_NUMBER if rng.random() < 0.6 else _WORD).finditer(data[:2000]))
    if not words:
        return data
    word = rng.choice(words)
    return data[: word.start()] + rng.choice(_TOKENS) + data[word.end() :]


def _insert(data: bytes, other: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.choice((*_TOKENS, rng.randbytes(rng.randrange(1, 40)))) + data[at:]


def _remove(data: bytes, other: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.randrange(1, 60) :]


def _repeat(data: bytes, other: bytes, rng: random.Random) -> bytes:
    first, last = sorted((rng.randrange(len(data)), rng.randrange(len(data))))
    return data[:last] + data[first:last] * rng.choice((1, 1, 2, 20)) + data[last:]


def _splice(data: bytes, other: bytes, rng: random.Random) -> bytes:
    return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]


def _lines(data: bytes, other: bytes, rng: random.Random) -> bytes:
    lines = data.split(b"\n")
    first, second = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[first], lines[second] = lines[second], lines[first]
    return b"\n".join(lines if rng.random() < 0.5 else lines[:first] + lines[first + 1 :])


_FAULTS = (
    _flip,
    _flip,
    _overwrite,
    _token,
    _token,
    _token,
    _insert,
    _remove,
    _repeat,
    _splice,
    _lines,
)


def outcome_of(seed: Seed, path: Path, data: bytes, was_cut: bool, tally: Tally) -> str:
    """Read a damaged file and return "ok", "refused", or the violation."""
    path.write_bytes(data)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    begin, outcome = time.perf_counter(), "ok"
    try:
        found = seed.read(path)
    except ScanlockError as error:
        outcome = "refused"
        tally.errors[type(error).__name__] += 1
    except MemoryError:
        outcome = "exceeded the memory limit"
    except Exception as error:
        outcome = f"{type(error).__name__}: {str(error)[:60]}"
    else:
        is_less = was_cut and 0 < len(getattr(found, "points", ())) < seed.stated
        if is_less and not found.notes:
            outcome = "lost points"
    seconds = time.perf_counter() - begin
    tally.slowest = max(tally.slowest, seconds)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 - before
    if seconds > _MAX_SECONDS:
        outcome = "exceeded the time limit"
    elif grown > _MAX_GROWTH + 64 * len(data):
        outcome = "used too much memory"
    return outcome


def fuzz(inputs: int, seed: int, keep: Path | None) -> dict[str, Tally]:
    """Return the outcomes of damaged inputs by kind of file."""
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory(dir=_memory_folder()) as name:
        folder = Path(name)
        known = list(seeds(folder))
        tallies = {one.name: Tally() for one in known}
        for one in known:
            one.read(_placed(folder, one))
        used = int(Path("/proc/self/statm").read_text().split()[0]) * 4096
        resource.setrlimit(resource.RLIMIT_AS, (used + _HEADROOM, resource.RLIM_INFINITY))
        for number in range(inputs):
            one, other = known[number % len(known)], rng.choice(known)
            data, was_cut = damaged(one.data, other.data, rng)
            tally = tallies[one.name]
            outcome = outcome_of(one, _path(folder, one), data, was_cut, tally)
            tally.outcomes[outcome] += 1
            if keep is not None and outcome not in ("ok", "refused"):
                path = keep / one.read.__name__ / f"{number}{_path(folder, one).suffix}"
                path.parent.mkdir(exist_ok=True)
                path.write_bytes(data)
            if number % 100_000 == 0:
                print(f"{number:,} of {inputs:,}", file=sys.stderr, flush=True)
    return tallies


def _path(folder: Path, seed: Seed) -> Path:
    if "." in seed.name:
        return folder / seed.name
    return folder / f"a.{seed.name.split()[0]}"


def _placed(folder: Path, seed: Seed) -> Path:
    path = _path(folder, seed)
    path.write_bytes(seed.data)
    return path


def _memory_folder() -> str | None:
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def main() -> None:
    parser = make_parser(__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--keep", type=Path, help="folder for inputs that violate a rule")
    arguments = parser.parse_args()
    results = Results(arguments.json)
    warnings.simplefilter("error")
    if arguments.keep is not None:
        arguments.keep.mkdir(parents=True, exist_ok=True)
    begin = time.perf_counter()
    tallies = fuzz(arguments.inputs, arguments.seed, arguments.keep)
    seconds = time.perf_counter() - begin
    print(f"{arguments.inputs:,} inputs in {seconds:.0f} s; {results.machine_line}\n")
    rows, violations = [], 0
    for name, tally in tallies.items():
        bad = {end: n for end, n in tally.outcomes.items() if end not in ("ok", "refused")}
        violations += sum(bad.values())
        rows.append([
            name, f"{tally.outcomes.total():,}",
            *(f"{tally.outcomes[end]:,}" for end in ("ok", "refused")),
            ", ".join(f"{count} {end}" for end, count in bad.items()) or "none",
            f"{1e3 * tally.slowest:.0f} ms",
        ])  # fmt: skip
    columns = ("file", "inputs", "read", "refused", "violations", "slowest")
    results.add_table(columns, rows, title="damaged files")
    with suppress(BrokenPipeError):
        sys.stdout.flush()
    sys.exit(1 if violations else 0)


if __name__ == "__main__":
    main()
