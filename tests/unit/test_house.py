"""Rules for the repository as a whole: imports, docstrings, layers and public names."""

import ast
import dataclasses
import importlib
import inspect
import os
import re
import subprocess
import sys
import textwrap
import tomllib
from pathlib import Path

import pytest

_ROOT = Path(__file__).resolve().parents[2]
_PACKAGE = _ROOT / "src" / "scanlock"
_MODULES = sorted(_PACKAGE.rglob("*.py"))
_KERNELS = sorted((_PACKAGE / "kernels").rglob("*.py"))
_MAX_LINES = 350
_MAX_MODULES = 20


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


@pytest.mark.slow
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


def test_a_module_is_short_and_says_what_it_is_for():
    texts = {_name(path): path.read_text(encoding="utf-8") for path in _MODULES}
    assert len(texts) > 300
    lengths = {name: len(text.splitlines()) for name, text in texts.items()}
    assert {name: count for name, count in lengths.items() if count >= _MAX_LINES} == {}
    assert [name for name, text in texts.items() if "TODO" in text] == []
    assert [name for name, text in texts.items() if not ast.get_docstring(ast.parse(text))] == []


@pytest.mark.parametrize(
    "folder", sorted({path.parent for path in _MODULES}), ids=lambda folder: folder.name
)
def test_a_folder_has_few_modules(folder):
    assert len(list(folder.glob("*.py"))) <= _MAX_MODULES


_PACKAGES = [
    path for folder in (_PACKAGE, _ROOT / "benchmarks") for path in folder.rglob("__init__.py")
]


@pytest.mark.parametrize("path", sorted(_PACKAGES), ids=lambda path: path.parent.name)
def test_a_package_docstring_says_what_does_not_belong_there(path):
    docstring = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    summary, _, rest = docstring.partition("\n\n")
    assert summary.endswith(".")
    elsewhere = re.findall(r"belongs? to|(?:is|are) [^.]*\bin\b|[Bb]eside|tested in", rest)
    assert elsewhere, f"{path}: name the package that similar code belongs to"


def test_the_page_of_tests_has_a_row_for_each_folder():
    page = (_ROOT / "tests" / "README.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `(\w+)/` \| [^|]+ \| [^|]+ \|$", page, flags=re.MULTILINE)
    folders = {path.name for path in (_ROOT / "tests").iterdir() if path.is_dir()}
    assert set(rows) == folders - {"__pycache__"}


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
    if path.name in ("_compile.py", "_cache.py", "_helper_compiler.py"):
        allowed = {
            "collections.abc",
            "contextlib",
            "functools",
            "hashlib",
            "importlib",
            "inspect",
            "logging",
            "pathlib",
            "typing",
            "numba",
            "numba.core",
            "scanlock.kernels._cache",
            "scanlock.kernels._helper_compiler",
        }
    imported = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add("." * node.level + (node.module or ""))
    assert imported <= allowed


def test_only_kernels_import_helpers_which_python_cannot_call():
    offenders = []
    for path in sorted((_ROOT / "src" / "scanlock").rglob("*.py")):
        if "kernels" in path.parts:
            continue
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
                "scanlock.kernels"
            ):
                is_inline = node.module == "scanlock.kernels._inline"
                private = [alias.name for alias in node.names if alias.name.startswith("_")]
                if is_inline or private:
                    offenders.append(f"{path.name}:{node.lineno}")
    assert not offenders


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


def _groups_of_public_names():
    """Public names by the comments of ``scanlock/__init__.pyi`` that group them."""
    groups = {}
    for line in (_PACKAGE / "__init__.pyi").read_text(encoding="utf-8").splitlines()[3:]:
        if line.startswith("# "):
            names = groups[line.removeprefix("# ")] = []
        elif found := re.search(r"(\w+) as \1", line):
            names.append(found[1])
    return groups


def test_the_page_of_the_api_has_the_groups_of_the_public_names():
    page = (_ROOT / "docs" / "api" / "index.md").read_text(encoding="utf-8")
    sections = dict(re.findall(r"^## ([^\n]+)\n(.*?)(?=^## |\Z)", page, re.MULTILINE | re.DOTALL))
    groups = _groups_of_public_names()
    packages = groups.pop("Packages")
    assert sorted(re.findall(r"`scanlock\.(\w+)`", sections.pop("Packages"))) == sorted(packages)
    assert groups == {
        title: re.findall(r"^   (\w+)$", text, re.MULTILINE) for title, text in sections.items()
    }
    assert len(groups) > 8


def test_every_public_name_is_listed_once_and_can_be_imported():
    import scanlock

    assert len(set(scanlock.__all__)) == len(scanlock.__all__) > 40
    for name in scanlock.__all__:
        assert getattr(scanlock, name).__doc__


def _public_objects():
    """Public functions and classes by name."""
    found = {}
    for package in (
        "scanlock",
        "scanlock.io",
        "scanlock.simulation",
        "scanlock.optimisation.solvers",
        "scanlock.optimisation.objectives",
    ):
        module = importlib.import_module(package)
        for name in module.__all__:
            value = getattr(module, name)
            if inspect.isfunction(value) or inspect.isclass(value):
                found.setdefault(value, f"{package}.{name}")
    return {name: value for value, name in found.items()}


def _public_functions():
    """Public functions, and public methods of public classes, by name."""
    found = {}
    for name, value in _public_objects().items():
        if inspect.isfunction(value):
            found[name] = value
            continue
        for own, member in vars(value).items():
            function = getattr(member, "__func__", member)
            if inspect.isfunction(function) and not own.startswith("_"):
                found[f"{name}.{own}"] = function
    return found


_OBJECTS = _public_objects()
_FUNCTIONS = _public_functions()
_DATACLASSES = [name for name, value in _OBJECTS.items() if dataclasses.is_dataclass(value)]


def _section(docstring, title):
    """The lines of a section of a docstring in the style of numpydoc."""
    found = re.search(
        rf"^{title}\n-+\n(.*?)(?=^\w[\w ]*\n---|\Z)", docstring, re.MULTILINE | re.DOTALL
    )
    return found[1].splitlines() if found else []


def _entries(docstring, title):
    """The names that a section describes."""
    heads = [line for line in _section(docstring, title) if line and not line[0].isspace()]
    return {name.strip() for head in heads for name in head.split(" : ")[0].split(",")}


def _attribute_docstrings(cls):
    """The names of the fields that are followed by a string in the source of a class."""
    [node] = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
    return {
        field.target.id
        for field, text in zip(node.body, node.body[1:], strict=False)
        if isinstance(field, ast.AnnAssign)
        and isinstance(field.target, ast.Name)
        and isinstance(text, ast.Expr)
        and isinstance(text.value, ast.Constant)
    }


def test_a_public_name_has_a_summary_of_one_sentence():
    docstrings = {
        name: inspect.getdoc(value) or "" for name, value in (_OBJECTS | _FUNCTIONS).items()
    }
    assert len(docstrings) > 300
    summaries = {name: text.partition("\n\n")[0] for name, text in docstrings.items()}
    assert [name for name, text in summaries.items() if not text.endswith((".", ":"))] == []
    assert [name for name, text in summaries.items() if "\n" in text] == []


@pytest.mark.parametrize("name", [name for name in _FUNCTIONS if name in _OBJECTS])
def test_a_public_function_documents_its_parameters_and_its_result(name):
    function = _FUNCTIONS[name]
    docstring = inspect.getdoc(function)
    signature = inspect.signature(function)
    assert set(signature.parameters) <= _entries(docstring, "Parameters")
    if signature.return_annotation not in (None, "None"):
        assert _section(docstring, "Returns") or _section(docstring, "Yields")


@pytest.mark.slow
@pytest.mark.parametrize("name", _DATACLASSES)
def test_a_public_dataclass_documents_its_fields(name):
    cls = _OBJECTS[name]
    documented = set()
    for base in filter(dataclasses.is_dataclass, cls.__mro__):
        documented |= _attribute_docstrings(base) | _entries(inspect.getdoc(base), "Attributes")
    fields = {field.name for field in dataclasses.fields(cls) if not field.name.startswith("_")}
    assert fields <= documented


@pytest.mark.parametrize("command", ["run", "tests"])
def test_the_readme_marks_its_commands_for_the_checks(command):
    readme = (_ROOT / "README.md").read_text(encoding="utf-8")
    [block] = re.findall(rf"^<!-- command: {command} -->\n```sh\n(.+)\n```$", readme, re.MULTILINE)
    assert block.startswith("python3 -m venv .venv && ")
