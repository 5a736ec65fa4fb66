import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import scanlock

_SCRIPT = """
import importlib, pkgutil, sys
import scanlock.kernels
from reference.samples import street
result = scanlock.register(source=street(2, 3000), target=street(1, 3000))
modules = pkgutil.walk_packages(scanlock.kernels.__path__, "scanlock.kernels.")
kernels = [
    value
    for module in modules
    for value in vars(importlib.import_module(module.name)).values()
    if hasattr(value, "stats")
]
cached = [one for one in kernels if one.stats.cache_path is not None]
print(scanlock.__file__, result.ok, cached, len(kernels) > 50)
"""


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
    assert (done.stdout, done.stderr) == (f"{package / '__init__.py'} True [] True\n", "")
    assert sorted(package.rglob("*")) == files
