"""Rules of the house that no single module can keep alone."""

import ast
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGE = _ROOT / "src" / "scanlock"
_MODULES = sorted(_PACKAGE.rglob("*.py"))
_KERNELS = sorted((_PACKAGE / "kernels").rglob("*.py"))
_MOST_LINES = 350


def _name(path):
    return ".".join(path.relative_to(_PACKAGE.parent).with_suffix("").parts).removesuffix(
        ".__init__"
    )


def _run(code, **environment):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=os.environ | environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_importing_scanlock_is_light_and_silent():
    heavy = ["numba", "scipy", "matplotlib", "laspy", "cyclopts"]
    code = f"import sys, scanlock; print([m for m in {heavy} if m in sys.modules])"
    done = _run(code)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_help_comes_without_the_packages_that_compute():
    heavy = ["numpy", "numba", "scipy", "matplotlib", "laspy"]
    code = f"""
import contextlib, io, sys
sys.argv = ["scanlock", "--help"]
from scanlock.cli import main
with contextlib.redirect_stdout(io.StringIO()), contextlib.suppress(SystemExit):
    main()
print([m for m in {heavy} if m in sys.modules])
"""
    done = _run(code)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_importing_every_module_compiles_nothing_and_prints_nothing(tmp_path):
    names = [_name(path) for path in _MODULES if path.name != "__main__.py"]
    code = f"""
import importlib, sys
modules = [importlib.import_module(name) for name in {names}]
compiled = [
    f"{{module.__name__}}.{{name}}"
    for module in modules
    for name, value in vars(module).items()
    if getattr(value, "signatures", None)
]
print(compiled, [m for m in ["matplotlib", "laspy"] if m in sys.modules])
"""
    done = _run(code, NUMBA_CACHE_DIR=str(tmp_path))
    assert (done.stdout, done.stderr) == ("[] []\n", "")
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


@pytest.mark.parametrize("path", _MODULES, ids=_name)
def test_a_module_is_short_and_says_what_it_is_for(path):
    text = path.read_text(encoding="utf-8")
    assert len(text.splitlines()) < _MOST_LINES
    assert "TODO" not in text
    assert ast.get_docstring(ast.parse(text))


@pytest.mark.parametrize("path", _KERNELS, ids=_name)
def test_a_kernel_file_knows_arrays_and_numba_only(path):
    # The digest of a cached kernel covers its own file and the shared ones, so kernels call none
    # but those.
    allowed = {
        "math",
        "numpy",
        "numpy.typing",
        "numba",
        "scanlock.arrays",
        "scanlock.kernels._compile",
        "scanlock.kernels._inline",
    }
    if path.name in ("_compile.py", "_cache.py"):
        allowed = {
            "collections.abc",
            "contextlib",
            "functools",
            "hashlib",
            "inspect",
            "logging",
            "pathlib",
            "typing",
            "numba",
            "numba.core",
            "scanlock.kernels._cache",
        }
    imported = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add("." * node.level + (node.module or ""))
    assert imported <= allowed


def _storeys():
    with (_ROOT / "pyproject.toml").open("rb") as file:
        contracts = tomllib.load(file)["tool"]["importlinter"]["contracts"]
    [layers] = [one["layers"] for one in contracts if one.get("containers") == ["scanlock"]]
    return [[name.strip(" ()") for name in layer.split("|")] for layer in layers]


def test_the_architecture_page_shows_the_storeys_of_the_import_contract():
    page = (_ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| (`[^|]+) \|", page, flags=re.MULTILINE)
    shown = [re.findall(r"`(\w+)`", row) for row in rows]
    assert shown == [[one for one in storey if one != "_lazy"] for storey in _storeys()]


def test_every_public_name_is_listed_once_and_can_be_imported():
    import scanlock

    assert len(set(scanlock.__all__)) == len(scanlock.__all__) > 40
    for name in scanlock.__all__:
        assert getattr(scanlock, name).__doc__


@pytest.mark.parametrize("command", ["run", "tests"])
def test_the_readme_marks_its_commands_for_the_checks(command):
    readme = (_ROOT / "README.md").read_text(encoding="utf-8")
    [block] = re.findall(rf"^<!-- command: {command} -->\n```sh\n(.+)\n```$", readme, re.MULTILINE)
    assert block.startswith("python3 -m venv .venv && ")
