import os
import re
import subprocess
import sys
from types import SimpleNamespace

import numba
import pytest

from scanlock.cli.commands.warm_up import cache_location

_needs_compiler = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")

_SCRIPT = """
import contextlib, importlib, io, json, pathlib, pkgutil, re
import scanlock, scanlock.kernels
from scanlock.cli import main
from scanlock.registration.compile_ahead import TABLE
with contextlib.redirect_stdout(io.StringIO()) as out:
    assert main(["warmup"]) == 0
assert "compiled" in out.getvalue()
assert "cached in" in out.getvalue()

package = pathlib.Path(scanlock.__file__).parent
callers = "".join(
    path.read_text()
    for path in package.rglob("*.py")
    if path.relative_to(package).parts[0] != "kernels"
)
table = {name: types for name, types, _ in json.loads(TABLE.read_text())}
cold = []
found = {}
for module in pkgutil.walk_packages(scanlock.kernels.__path__, "scanlock.kernels."):
    if "._" in module.name:
        continue
    for name, value in vars(importlib.import_module(module.name)).items():
        if name.startswith("_") or getattr(value, "__module__", "") != module.name:
            continue
        if hasattr(value, "signatures") and re.search(rf"\\b{name}[(]", callers):
            key = f"{module.name}.{name}".removeprefix("scanlock.kernels.")
            found[key] = [repr(one) for one in value.nopython_signatures[0].args]
            if len(value.signatures) != 1:
                cold.append((module.name, name, len(value.signatures)))
assert len(found) > 60, found
# After a change: python -m benchmarks.speed.kernel_table
print(cold, sorted(name for name in {**found, **table} if found.get(name) != table.get(name)))
"""


@pytest.mark.slow
@_needs_compiler
def test_every_kernel_is_compiled_with_the_one_signature_of_the_table():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _SCRIPT],
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("[] []\n", "")


@pytest.mark.slow
@_needs_compiler
def test_a_second_run_compiles_nothing(scanlock):
    scanlock("warmup")
    done = scanlock("warmup")
    assert (done.code, done.err) == (0, "")
    first, second = done.out.splitlines()
    assert re.fullmatch(r"everything was compiled already; loaded it in [\d.]+ s", first)
    assert second.startswith("cached in ")
    assert os.path.isdir(second.removeprefix("cached in "))


@pytest.mark.parametrize(
    ("kernel", "remedy"),
    [
        (SimpleNamespace(stats=SimpleNamespace(cache_path=None)), "NUMBA_CACHE_DIR"),
        (SimpleNamespace(), "NUMBA_DISABLE_JIT"),
    ],
)
def test_a_remedy_is_named_without_a_compiler_or_a_cache(monkeypatch, kernel, remedy):
    monkeypatch.setattr("scanlock.kernels.points.polar.polar_cells", kernel)
    assert remedy in cache_location()
