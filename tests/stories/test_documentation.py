"""Examples of the documentation and the README, run as printed; the architecture page, traced."""

import ast
import contextlib
import doctest
import importlib
import io
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import scanlock
from scanlock import METHODS
from scanlock.cli import main
from scanlock.simulation import scan_pair

_ROOT = Path(__file__).resolve().parents[2]
_PAGES = [
    page
    for page in [_ROOT / "README.md", *sorted((_ROOT / "docs").glob("*.md"))]
    if "```pycon" in page.read_text(encoding="utf-8")
]


@pytest.mark.slow
@pytest.mark.parametrize("page", _PAGES, ids=lambda page: page.name)
def test_the_examples_of_a_page_print_the_shown_output(page):
    blocks = re.findall(r"^```pycon\n(.*?)^```$", page.read_text("utf-8"), re.DOTALL | re.MULTILINE)
    session = "\n".join(blocks)
    example = doctest.DocTestParser().get_doctest(session, {}, page.name, str(page), 0)
    report = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    outcome = runner.run(example, out=report.append)
    assert outcome.attempted > 0
    assert outcome.failed == 0, "".join(report)


@pytest.mark.slow
def test_the_method_of_the_how_to_page_runs(monkeypatch, tmp_path):
    text = (_ROOT / "docs" / "how-to" / "add-a-method.md").read_text("utf-8")
    code = "\n".join(re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE))
    [entry] = re.findall(r"^plane-icp = \"(.*)\"$", text, re.MULTILINE)
    monkeypatch.setattr(METHODS, "_methods", dict(METHODS._methods))
    (tmp_path / "page.py").write_text(code)
    monkeypatch.syspath_prepend(tmp_path)
    page = importlib.import_module("page")

    # The command line finds the method through the entry point of an installed package.
    package = tmp_path / "my_package.py"
    package.write_text("from page import PlaneIcp\n\nPLANE_ICP = PlaneIcp()\n")
    info = tmp_path / "my_package-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-package\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[scanlock.methods]\nplane-icp = {entry}\n")
    monkeypatch.setattr(METHODS, "_methods", {"gicp": METHODS["gicp"]})
    monkeypatch.setattr(METHODS, "_offered", None)
    for name, scan in (("source", page.pair.source), ("target", page.pair.target)):
        np.save(tmp_path / f"{name}.npy", scan.points)
    start = page.pair.target_from_source
    np.savetxt(tmp_path / "start.txt", start.matrix)
    files = [str(tmp_path / f"{name}.npy") for name in ("source", "target")]
    options = ["--method", "plane-icp", "--initial", str(tmp_path / "start.txt")]
    assert main(["register", *files, *options]) == 0


def _calls_of(work):
    """Return the calls of scanlock during some work, each with those that contain it."""
    package = Path(scanlock.__file__).parent
    calls, stack = [], []

    def profile(frame, event, _):
        path = Path(frame.f_code.co_filename)
        if not path.is_relative_to(package):
            return
        if event == "call":
            stack.append((frame.f_code.co_qualname, path.relative_to(package).as_posix()))
            calls.append(tuple(stack))
        elif event == "return" and stack:
            stack.pop()

    sys.setprofile(profile)
    try:
        work()
    finally:
        sys.setprofile(None)
    return calls


@pytest.mark.slow
def test_the_calls_of_a_registration_are_those_of_the_architecture_page():
    text = (_ROOT / "docs" / "architecture.md").read_text("utf-8")
    tree = re.search(r"## The way of a scan.*?```text\n(.*?)```", text, re.DOTALL)[1]
    pair = scan_pair("street", "hdl_32e", seed=1)
    calls = _calls_of(
        lambda: scanlock.register(
            source=pair.source.points,
            target=pair.target.points,
            covariance="sandwich",
            threads=1,
        )
    )
    parents, position = [], 0
    for line in tree.splitlines():
        indent, name, file = re.match(r"([│├└─ ]*)(\S+) +(\S+\.py)", line).groups()
        parents = [*parents[: len(indent) // 4], (name, file)]
        found = (
            index
            for index, chain in enumerate(calls)
            if index >= position
            and chain[-1] == parents[-1]
            and all(parent in chain for parent in parents)
        )
        position = next(found, None)
        assert position is not None, f"{name} of {file} is not called there"
    assert len(tree.splitlines()) > 20


def test_the_places_of_the_architecture_page_exist():
    text = (_ROOT / "docs" / "architecture.md").read_text("utf-8")
    places = re.findall(r"^\| [^|`]+ \| ([^|]*`[^|]*) \|$", text, re.MULTILINE)
    assert len(places) >= 12
    for place in re.findall(r"`(.*?)`", " ".join(places)):
        assert (_ROOT / "src" / "scanlock" / place).exists(), place


@pytest.mark.slow
def test_the_command_line_page_is_the_help(monkeypatch):
    monkeypatch.syspath_prepend(_ROOT / "docs")
    page = importlib.import_module("command_line").page()
    written = (_ROOT / "docs" / "command-line.md").read_text("utf-8")
    assert written == page, "run: python docs/command_line.py > docs/command-line.md"


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted((_ROOT / "docs").rglob("*.ipynb")), ids=lambda p: p.stem)
def test_the_cells_of_a_notebook_print_the_shown_output(path):
    space = {}
    for cell in json.loads(path.read_text("utf-8"))["cells"]:
        if cell["cell_type"] != "code":
            continue
        shown = "".join(
            "".join(one["text"] if "text" in one else one["data"]["text/plain"])
            for one in cell["outputs"]
        )
        # The last digits of a pose differ between processors.
        assert _without_digits(_output("".join(cell["source"]), space)) == _without_digits(shown)


def _output(source, space):
    """Run a cell, and return its printed lines and the value of its last expression."""
    *statements, last = ast.parse(source).body
    printed = io.StringIO()
    value = None
    with contextlib.redirect_stdout(printed):
        exec(compile(ast.Module(statements, []), "cell", "exec"), space)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), space)
        else:
            exec(compile(ast.Module([last], []), "cell", "exec"), space)
    return printed.getvalue() + ("" if value is None else repr(value))


def _without_digits(text):
    return re.sub(r"[ -]*\d+(\.\d+)?", " #", text)
