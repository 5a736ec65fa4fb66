"""Interrupted, terminated or killed commands leave complete files and print nothing else."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
import traceback
from dataclasses import replace
from pathlib import Path

import numba
import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock import cli, io
from scanlock.cli import main
from scanlock.cli.commands import simulate
from scanlock.geometry.pose import Pose
from scanlock.simulation import CAR, Drive, SimulatedSequence, SurfaceClass, World, boxes, hdl_32e

if numba.config.DISABLE_JIT or "fork" not in multiprocessing.get_all_start_methods():
    pytest.skip("needs compiled kernels and fork", allow_module_level=True)

pytestmark = [
    pytest.mark.stress,
    pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning"),
]

_SCANS = 3
_SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]
_CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}

_WRITERS = tuple(str(Path(package.__file__).parent) for package in (cli, io))


@pytest.fixture(scope="module")
def workplace(tmp_path_factory):
    """A working folder with a folder of scans."""
    workplace = tmp_path_factory.mktemp("workplace")
    (workplace / "drive").mkdir()
    for k in range(_SCANS):
        scan = yaw_pose(0.1 * k, (1.5 * k, 0.0, 0.0)).inverse().apply(street(k + 1, 3000))
        io.write_scan(workplace / "drive" / f"{k}.npy", scan)
    return workplace


@pytest.fixture
def world(monkeypatch):
    """A wall instead of a street, which takes seconds to generate."""
    wall = World.of([boxes([[8.0, 0.0, 0.0]], [[1.0, 5.0, 5.0]], SurfaceClass.BUILDING)])
    poses = tuple(Pose(np.eye(3), np.array([0.1 * k, 0.0, 0.0])) for k in range(_SCANS))
    drive = Drive(poses, np.zeros((_SCANS, 6)), np.arange(_SCANS) / CAR.speed)
    sensor = replace(hdl_32e(), azimuth_steps=256)
    sequence = SimulatedSequence(world=wall, sensor=sensor, drive=drive, seed=0)
    monkeypatch.setattr(simulate, "_sequence", lambda *_: sequence)


class _Watch:
    """Trace function that sends a signal at a given change of the files in the folder `out`.

    A change is any difference of names or sizes between two traced lines of the code that writes
    files. Changes are the same in every run, and none is missed.
    """

    def __init__(self, number, moment):
        self.changes = 0
        self._number, self._moment = number, moment
        self._sizes = _sizes()

    def __call__(self, frame, event, _):
        if not frame.f_code.co_filename.startswith(_WRITERS):
            return None
        if event == "line" and self._sizes != (sizes := _sizes()):
            self._sizes = sizes
            self.changes += 1
            if self.changes == self._moment:
                os.kill(os.getpid(), self._number)
        return self


def _sizes():
    return [
        (name, os.stat(os.path.join(folder, name)).st_size)
        for folder, _, names in os.walk("out")
        for name in names
    ]


def _run(arguments, number=None, moment=0):
    """Run a command in a forked process; return its exit code, stderr and number of changes."""
    Path("changes").touch()
    child = os.fork()
    if child == 0:
        code = 99
        try:
            with open("stdout", "w") as sys.stdout, open("stderr", "w") as sys.stderr:
                watch = _Watch(number, moment)
                sys.settrace(watch)
                try:
                    code = main(arguments)
                except BaseException:
                    traceback.print_exc()
                finally:
                    sys.settrace(None)
            Path("changes").write_text(str(watch.changes))
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    return code, Path("stderr").read_text(), int(Path("changes").read_text() or "0")


def _interrupted_runs(arguments, number, max_runs, old=()):
    """Interrupt a command at evenly spaced changes; check each exit, and yield the change.

    The folder `out` is empty before, or for every second run contains the files `old`.
    """
    shutil.rmtree("out", ignore_errors=True)
    Path("out").mkdir()
    main(arguments)  # in this process, so that forks need not import or compile
    fresh = {path.name: path.read_bytes() for path in Path("out").iterdir() if path.is_file()}
    shutil.rmtree("out")
    Path("out").mkdir()
    code, error, changes = _run(arguments)
    assert (code, error) == (0, "")
    assert changes > 0
    step = -(-changes // max_runs)
    # Signals take different changes, if not all can be tested.
    for moment in range(1 + _SIGNALS.index(number) % step, changes + 1, step):
        shutil.rmtree("out")
        Path("out").mkdir()
        for name, content in old if moment % 2 else ():
            Path("out", name).write_bytes(content)
        code, error, _ = _run(arguments, number, moment)
        assert (code, error) == (_CODES[number], "")
        assert number == signal.SIGKILL or not list(Path("out").rglob("*.part"))
        yield moment, fresh


@pytest.mark.parametrize("number", _SIGNALS)
@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (("register", "drive/0.npy", "drive/1.npy", "-o", "out/pose.txt"), "pose.txt"),
        (("segment", "drive/0.npy", "-o", "out/labels.npy"), "labels.npy"),
    ],
)
def test_a_file_is_the_old_or_the_complete_new_one(workplace, monkeypatch, arguments, name, number):
    monkeypatch.chdir(workplace)
    old = b"1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    contents = set()
    for _, fresh in _interrupted_runs(arguments, number, 5, [(name, old)]):
        contents.add(_content(name))
        assert contents <= {b"", old, fresh[name]}
    assert len(contents) > 1


@pytest.mark.parametrize("number", _SIGNALS)
def test_an_interrupt_leaves_the_map_so_far_and_a_kill_its_poses(workplace, monkeypatch, number):
    monkeypatch.chdir(workplace)
    # Without the slow figure, which is written like other files.
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    arguments = ("map", "drive", "-o", "out")
    for moment, fresh in _interrupted_runs(arguments, number, 5):
        # Four files for each scan, scans.csv first, each created, filled and renamed, and one of
        # options after the first scan; then the four again.
        change = moment - 1
        scans, change = divmod(change - 3 if change >= 15 else min(change, 11), 12)
        added = min(scans + 1, _SCANS)
        rows = [
            _rows(name, fresh)
            for name in ("trajectory_kitti.txt", "trajectory_tum.txt", "pairs.csv")
        ]
        if number == signal.SIGKILL:
            is_behind = scans < _SCANS
            assert rows == [added - (is_behind and change < end) for end in (5, 8, 11)]
            assert _content("map.ply") in (b"", fresh["map.ply"])
        else:
            assert rows == [added] * 3
            points = len(io.read_scan("out/map.ply").points)
            assert (_content("map.ply") == fresh["map.ply"]) == (added == _SCANS)
            assert points >= 500 * added


def _content(name):
    """Return the content of a file, which must not be empty; nothing if it does not exist."""
    path = Path("out", name)
    if not path.exists():
        return b""
    content = path.read_bytes()
    assert content
    return content


def _rows(name, fresh):
    """Return the number of complete lines of a file, which must be the first ones of the output."""
    content = _content(name)
    assert _without_times(name, fresh[name]).startswith(_without_times(name, content))
    assert content.endswith(b"\n") or not content
    return content.count(b"\n")


def _without_times(name, content):
    """Return a file without its last column, if that has wall times."""
    if name != "pairs.csv":
        return content
    return b"\n".join(line.rpartition(b",")[0] for line in content.splitlines())


@pytest.mark.parametrize("number", _SIGNALS)
def test_simulated_scans_have_their_labels_and_poses(workplace, world, monkeypatch, number):
    monkeypatch.chdir(workplace)
    arguments = ("simulate", "street", "-o", "out", "--sensor", "hdl-32e", "--scans", str(_SCANS))
    for _, fresh in _interrupted_runs(arguments, number, 5):
        scans = sorted(Path("out", "scans").glob("[!.]*"))
        labels = sorted(Path("out", "labels").glob("[!.]*"))
        kitti, tum = (_rows(name, fresh) for name in ("poses_kitti.txt", "poses_tum.txt"))
        for scan, label in zip(scans, labels, strict=False):
            io.read_labels(label, count=len(io.read_scan(scan)))
        if number == signal.SIGKILL:
            assert len(scans) >= len(labels) >= kitti >= tum >= len(scans) - 1
            assert all(len(io.read_scan(scan)) > 500 for scan in scans)
        else:
            assert len(scans) == len(labels) == kitti == tum > 0


_PROGRAM = "import sys; from scanlock.cli import main; sys.exit(main())"

_WATCHED = """
import os, signal, sys

def watch(event, arguments):
    if event == "import" and arguments[0] == sys.argv[1]:
        os.kill(os.getpid(), signal.SIGINT)

sys.addaudithook(watch)
from scanlock.cli import main
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.parametrize("module", ["cyclopts", "numba.core.types"])
def test_an_interrupt_during_imports_prints_nothing(workplace, module):
    done = subprocess.run(
        [sys.executable, "-c", _WATCHED, module, "segment", "drive/0.npy", "-o", "labels.npy"],
        cwd=workplace,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
    assert not (workplace / "labels.npy").exists()


def test_an_interrupt_during_compilation_prints_nothing(workplace, tmp_path):
    cache = tmp_path / "cache"
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "segment", "drive/0.npy", "-o", "labels.npy"],
        cwd=workplace,
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        # When the first kernel is cached, the next one is being compiled.
        while process.poll() is None and not list(cache.rglob("*.nbc")):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate()
    assert (process.returncode, out, error) == (130, "", "")
    assert not (workplace / "labels.npy").exists()
