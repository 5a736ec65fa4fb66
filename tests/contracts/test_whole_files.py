"""Commands that are interrupted, asked to end or killed leave whole files, and no other word."""

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
    pytest.skip("needs a compiler, and a system that can fork", allow_module_level=True)

pytestmark = pytest.mark.filterwarnings(
    "ignore:This process .* is multi-threaded:DeprecationWarning"
)

_SCANS = 3
_SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGKILL]
_CODES = {signal.SIGINT: 130, signal.SIGTERM: 143, signal.SIGKILL: -signal.SIGKILL}

_WRITERS = tuple(str(Path(package.__file__).parent) for package in (cli, io))


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a folder of scans."""
    place = tmp_path_factory.mktemp("place")
    (place / "drive").mkdir()
    for k in range(_SCANS):
        scan = yaw_pose(0.1 * k, (1.5 * k, 0.0, 0.0)).inverse().apply(street(k + 1, 3000))
        io.write_scan(place / "drive" / f"{k}.npy", scan)
    return place


@pytest.fixture
def world(monkeypatch):
    """A wall to drive along, in place of a street that takes seconds to build."""
    wall = World.of([boxes([[8.0, 0.0, 0.0]], [[1.0, 5.0, 5.0]], SurfaceClass.BUILDING)])
    poses = tuple(Pose(np.eye(3), np.array([0.1 * k, 0.0, 0.0])) for k in range(_SCANS))
    drive = Drive(poses, np.zeros((_SCANS, 6)), np.arange(_SCANS) / CAR.speed)
    sequence = SimulatedSequence(wall, replace(hdl_32e(), azimuth_steps=256), drive, 0)
    monkeypatch.setattr(simulate, "_sequence", lambda *_: sequence)


class _Watch:
    """Follows the lines that write files, and sends a signal at a change of what is on disk.

    A change is all that files of the folder `out` show between two lines: a new one, another
    size, another name. That makes moments which are the same in every run, and none is missed.
    """

    def __init__(self, number, moment):
        self.changes = 0
        self._number, self._moment = number, moment
        self._seen = _sizes()

    def __call__(self, frame, event, _):
        if not frame.f_code.co_filename.startswith(_WRITERS):
            return None
        if event == "line" and self._seen != (seen := _sizes()):
            self._seen = seen
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
    """Run a command in a copy of this process; return its exit code, stderr and changes."""
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


def _interrupted_runs(arguments, number, most, old=()):
    """Run a command, interrupted at moments all over it, and yield each after checking its end.

    The folder `out` holds nothing before, or of every second run what `old` says.
    """
    shutil.rmtree("out", ignore_errors=True)
    main(arguments)  # here, so that no copy of this process has to load or compile anything
    fresh = {path.name: path.read_bytes() for path in Path("out").iterdir() if path.is_file()}
    shutil.rmtree("out")
    code, error, changes = _run(arguments)
    assert (code, error) == (0, "")
    assert changes > 0
    step = -(-changes // most)
    # Another signal, other moments, if not all can be taken.
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
def test_a_file_is_the_old_one_or_the_new_one(place, monkeypatch, arguments, name, number):
    monkeypatch.chdir(place)
    old = b"1 0 0 0\n0 1 0 0\n0 0 1 0\n"
    seen = set()
    for _, fresh in _interrupted_runs(arguments, number, 5, [(name, old)]):
        seen.add(_content(name))
        assert seen <= {b"", old, fresh[name]}
    assert len(seen) > 1


@pytest.mark.parametrize("number", _SIGNALS)
def test_a_map_is_left_up_to_there_and_its_poses_even_by_a_kill(place, monkeypatch, number):
    monkeypatch.chdir(place)
    # Drawing is slow, and a picture is written as all other files are.
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    arguments = ("map", "drive", "-o", "out")
    for moment, fresh in _interrupted_runs(arguments, number, 5):
        # Three files for each scan, each of them begun, filled and renamed; then all once more.
        scans, change = divmod(moment - 1, 9)
        laid = min(scans + 1, _SCANS)
        rows = [
            _rows(name, fresh)
            for name in ("trajectory_kitti.txt", "trajectory_tum.txt", "pairs.csv")
        ]
        if number == signal.SIGKILL:
            is_behind = scans < _SCANS
            assert rows == [laid - (is_behind and change < end) for end in (2, 5, 8)]
            assert _content("map.ply") in (b"", fresh["map.ply"])
        else:
            assert rows == [laid] * 3
            points = len(io.read_scan("out/map.ply").points)
            assert (_content("map.ply") == fresh["map.ply"]) == (laid == _SCANS)
            assert points >= 500 * laid


def _content(name):
    """Return what is in a file; nothing only if it is not there."""
    path = Path("out", name)
    if not path.exists():
        return b""
    content = path.read_bytes()
    assert content
    return content


def _rows(name, fresh):
    """Return how many whole lines of those that the command writes are there."""
    content = _content(name)
    assert fresh[name].startswith(content)
    assert content.endswith(b"\n") or not content
    return content.count(b"\n")


@pytest.mark.parametrize("number", _SIGNALS)
def test_simulated_scans_have_their_labels_and_poses(place, world, monkeypatch, number):
    monkeypatch.chdir(place)
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
def test_an_interrupt_while_modules_are_loaded_is_quiet(place, module):
    done = subprocess.run(
        [sys.executable, "-c", _WATCHED, module, "segment", "drive/0.npy", "-o", "new/labels.npy"],
        cwd=place,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")
    assert not (place / "new").exists()


def test_an_interrupt_while_kernels_are_compiled_is_quiet(place, tmp_path):
    cache = tmp_path / "cache"
    with subprocess.Popen(
        [sys.executable, "-c", _PROGRAM, "segment", "drive/0.npy", "-o", "new/labels.npy"],
        cwd=place,
        env=os.environ | {"NUMBA_CACHE_DIR": str(cache)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        # Once the first kernel is kept, the next one is in the making.
        while process.poll() is None and not list(cache.rglob("*.nbc")):
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        out, error = process.communicate()
    assert (process.returncode, out, error) == (130, "", "")
    assert not (place / "new").exists()
