"""Examples of the documentation and the README, run as printed."""

import doctest
import importlib
import re
from pathlib import Path

import numpy as np
import pytest

from scanlock import METHODS
from scanlock.cli import main

_ROOT = Path(__file__).resolve().parents[2]
_PAGES = [
    page
    for page in [_ROOT / "README.md", *sorted((_ROOT / "docs").glob("*.md"))]
    if "```pycon" in page.read_text(encoding="utf-8")
]


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
