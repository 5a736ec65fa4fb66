import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import pytest

import scanlock

_HERE = """
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
kept = [one for one in kernels if one.stats.cache_path is not None]
print(scanlock.__file__, result.ok, kept, len(kernels) > 50)
"""


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="without a compiler there is nothing to keep")
def test_a_read_only_installation_and_home_work(tmp_path):
    # Root may write anywhere, so what cannot be a folder stands where folders would be made.
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
        [sys.executable, "-W", "error", "-c", _HERE],
        env=environment
        | {
            "HOME": str(tmp_path / "home" / "sweet"),
            "PYTHONPATH": os.pathsep.join([str(tmp_path), str(Path(__file__).parents[2])]),
            "PYTHONDONTWRITEBYTECODE": "1",
            "NUMBA_OPT": "0",  # all is compiled: let that be quick
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == (f"{package / '__init__.py'} True [] True\n", "")
    assert sorted(package.rglob("*")) == files
