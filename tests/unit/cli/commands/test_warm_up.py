import multiprocessing
import os
import re
import signal
import subprocess
import sys
from types import SimpleNamespace

import numba
import pytest

from scanlock.cli.commands import warm_up
from scanlock.cli.commands.warm_up import cache_location, ordered

_needs_compiler = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")

_SCRIPT = """
import contextlib, importlib, io, pathlib, pkgutil, re
import scanlock, scanlock.kernels
from scanlock.cli import main
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
cold = []
found = 0
for module in pkgutil.walk_packages(scanlock.kernels.__path__, "scanlock.kernels."):
    if "._" in module.name:
        continue
    for name, value in vars(importlib.import_module(module.name)).items():
        if name.startswith("_") or getattr(value, "__module__", "") != module.name:
            continue
        if hasattr(value, "signatures") and re.search(rf"\\b{name}[(]", callers):
            found += 1
            if len(value.signatures) != 1:
                cold.append((module.name, name, len(value.signatures)))
assert found > 60, found
print(cold)
"""


@pytest.mark.slow
@_needs_compiler
def test_every_kernel_is_compiled_with_one_signature():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", _SCRIPT],
        env=os.environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("[]\n", "")


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


def test_processes_start_with_different_steps():
    steps = list(range(9))
    orders = [ordered(steps, number) for number in range(4)]
    assert all(sorted(order) == steps for order in orders)
    assert orders[0] == steps
    assert orders[1] == steps[::-1]
    assert len({order[0] for order in orders}) == 4


def test_only_the_first_process_receives_the_interrupt_of_a_terminal(scanlock, monkeypatch):
    handlers = []

    class Helper:
        def __init__(self, **_):
            pass

        def start(self):
            handlers.append(signal.getsignal(signal.SIGINT))

        def join(self):
            handlers.append(signal.getsignal(signal.SIGINT))

    taken = multiprocessing.Array("b", 1)
    context = SimpleNamespace(Array=lambda *_: taken, Process=Helper)
    monkeypatch.setattr("multiprocessing.get_context", lambda _: context)
    monkeypatch.setattr("scanlock.registration.warm_up.warm_up_verification", lambda: None)
    monkeypatch.setattr(warm_up, "_compiles_here", lambda: True)
    monkeypatch.setattr(warm_up, "_cores", lambda: 2)
    monkeypatch.setattr(warm_up, "_steps", lambda: [lambda: None])
    assert scanlock("warmup").code == 0
    assert handlers == [signal.SIG_IGN, signal.default_int_handler]
