"""Damaged files that once broke a reader, and a few thousand new ones."""

import contextlib
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scanlock import io
from scanlock.errors import FormatError, ScanlockError

pytestmark = pytest.mark.stress

_ROOT = Path(__file__).parents[2]
_CORPUS = sorted(path for path in (_ROOT / "tests" / "corpus").glob("*/*") if path.is_file())


def test_the_corpus_is_complete():
    assert len(_CORPUS) >= 40


@pytest.mark.parametrize("path", _CORPUS, ids=lambda path: f"{path.parent.name}-{path.name}")
def test_files_of_the_corpus_are_read_or_refused(path):
    reader = getattr(io, path.parent.name)
    with contextlib.suppress(ScanlockError):
        assert reader(path) is not None


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("layers.laz", "that holds its layers"),
        ("chunk_size.laz", "found chunks of 4278240080"),
        ("no_items.laz", "found items of 0"),
    ],
)
def test_damaged_laz_sizes_are_refused_before_memory_is_allocated(name, message):
    pytest.importorskip("laspy")
    with pytest.raises(FormatError, match=message):
        io.read_scan(_ROOT / "tests" / "corpus" / "read_scan" / name)


@pytest.mark.skipif(sys.platform != "linux", reason="limits memory as Linux does")
def test_randomly_damaged_files_raise_format_errors_only(tmp_path):
    command = [sys.executable, "-m", "benchmarks.io.fuzz_readers", "--inputs", "5600"]
    done = subprocess.run(
        [*command, "--seed", "7", "--keep", tmp_path],
        cwd=_ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("| none |") == 28


class _PickleTrap:
    """An object whose pickle writes a file when it is read."""

    def __init__(self, path):
        self._path = path

    def __reduce__(self):
        return open, (str(self._path), "w")


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.bin", "a.txt", "a.pcd", "a.pkl"])
def test_pickles_are_never_read(tmp_path, name):
    sprung, path = tmp_path / "sprung", tmp_path / name
    trap = np.array([_PickleTrap(sprung)], dtype=object)
    if name.endswith(".npy"):
        np.save(path, trap, allow_pickle=True)
    elif name.endswith(".npz"):
        np.savez(path, points=trap)
    else:
        path.write_bytes(pickle.dumps(_PickleTrap(sprung)))
    for reader in (io.read_scan, io.read_pose, io.read_labels):
        with pytest.raises(ScanlockError):
            reader(path)
    assert not sprung.exists()
    pickle.loads(pickle.dumps(_PickleTrap(sprung))).close()
    assert sprung.exists()


def test_a_panic_of_the_decompressor_is_a_format_error(monkeypatch, tmp_path):
    laspy = pytest.importorskip("laspy")
    path = tmp_path / "a.las"
    io.write_scan(path, np.random.default_rng(0).uniform(-9.0, 9.0, (5, 3)))

    def panics(stream):
        raise type("PanicException", (BaseException,), {})("index out of bounds")

    def interrupted(stream):
        raise KeyboardInterrupt

    monkeypatch.setattr(laspy, "read", panics)
    with pytest.raises(FormatError, match="index out of bounds"):
        io.read_scan(path)
    monkeypatch.setattr(laspy, "read", interrupted)
    with pytest.raises(KeyboardInterrupt):
        io.read_scan(path)
