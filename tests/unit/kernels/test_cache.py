import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import scanlock
from scanlock.kernels import _cache


def test_the_digest_covers_the_file_of_a_kernel_and_the_shared_files(tmp_path, monkeypatch):
    monkeypatch.setattr(_cache, "__file__", str(tmp_path / "_cache.py"))
    own, shared = tmp_path / "polar.py", tmp_path / "_inline.py"
    digests = set()
    for own_text, shared_text in (("a", "b"), ("c", "b"), ("c", "d")):
        own.write_text(own_text)
        shared.write_text(shared_text)
        digests.add(_cache.digest_of.__wrapped__(str(own)))
    assert len(digests) == 3


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_copies_of_a_kernel_in_two_folders_share_the_cache(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    code = "from scanlock.kernels._compile import kernel\n@kernel\ndef f(a):\n    return 3 * a\n"
    stats = []
    for folder in ("one", "two"):
        path = tmp_path / folder / "kernels" / "triple.py"
        path.parent.mkdir(parents=True)
        path.write_text(code)
        scope = {"__name__": "triple"}
        exec(compile(code, str(path), "exec"), scope)
        assert scope["f"](2) == 6
        stats.append(scope["f"].stats)
    assert [bool(one.cache_hits) for one in stats] == [False, True]
    assert stats[0].cache_path == stats[1].cache_path


@pytest.mark.slow
def test_a_kernel_works_without_a_writable_cache():
    # This locator caches archives only, so Numba finds no folder for its cache.
    code = (
        "import numpy as np\n"
        "from scanlock.kernels.points.polar import polar_cells\n"
        "print(polar_cells(np.array([[1.0, 0.1, 0.0]]), 4, np.array([0.0, 2.0])))\n"
    )
    environment = os.environ | {"NUMBA_CACHE_LOCATOR_CLASSES": "ZipCacheLocator"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("[0]\n", "")


_SCRIPT = """
import importlib, pkgutil, sys
import scanlock.kernels
from reference.samples import street
from scanlock.clouds.point_tree import PointTree
from scanlock.clouds.voxel_grid import voxel_means
tree = PointTree.from_points(voxel_means(street(1, 3000), 0.5))
rows, distances = tree.nearest(tree.points, 1.0)
modules = pkgutil.walk_packages(scanlock.kernels.__path__, "scanlock.kernels.")
kernels = [
    value
    for module in modules
    for value in vars(importlib.import_module(module.name)).values()
    if hasattr(value, "stats")
]
cached = [one for one in kernels if one.stats.cache_path is not None]
print(scanlock.__file__, distances.max(), cached, len(kernels) > 50)
"""


@pytest.mark.slow
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_kernels_work_with_a_read_only_installation_and_home(tmp_path):
    # Root can write everywhere, so files are in the places of the cache folders.
    package = tmp_path / "scanlock"
    shutil.copytree(
        Path(scanlock.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    for folder in [one for one in (package / "kernels").rglob("*") if one.is_dir()]:
        (folder / "__pycache__").touch()
    (package / "kernels" / "__pycache__").touch()
    (tmp_path / "home").touch()
    files = sorted(package.rglob("*"))
    unset = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA", "USERPROFILE")
    environment = {name: text for name, text in os.environ.items() if name not in unset}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _SCRIPT],
        env=environment
        | {
            "HOME": str(tmp_path / "home" / "sweet"),
            "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])]),
            "PYTHONDONTWRITEBYTECODE": "1",
            "NUMBA_OPT": "0",  # reduces the time of compilation
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == (f"{package / '__init__.py'} 0.0 [] True\n", "")
    assert sorted(package.rglob("*")) == files
