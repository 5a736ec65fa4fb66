"""Benchmark commands have help, write their results, and the page of results is up to date."""

import importlib
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import pytest

_ROOT = Path(__file__).resolve().parents[2]
_FOLDER = _ROOT / "benchmarks"
_SUBJECTS = ("speed", "accuracy", "robustness", "uncertainty", "io")
_COMMANDS = [
    f"benchmarks.{subject}.{path.stem}"
    for subject in _SUBJECTS
    for path in sorted((_FOLDER / subject).glob("*.py"))
    if path.stem != "__init__"
]

pytestmark = pytest.mark.skipif(not _FOLDER.is_dir(), reason="needs the benchmarks")


@pytest.fixture
def root_on_path(monkeypatch):
    monkeypatch.syspath_prepend(_ROOT)


@pytest.mark.parametrize("command", _COMMANDS)
def test_every_command_has_help_and_writes_results(root_on_path, command, monkeypatch, capsys):
    module = importlib.import_module(command)
    monkeypatch.setattr(sys, "argv", [command, "--help"])
    with pytest.raises(SystemExit) as exit_:
        module.main()
    assert exit_.value.code == 0
    assert "--json FILE" in capsys.readouterr().out
    assert f"python -m {command}" in module.__doc__


def test_a_results_file_names_commit_machine_and_tables(
    root_on_path, monkeypatch, tmp_path, capsys
):
    results = importlib.import_module("benchmarks._common.results")
    words = ["--data", str(tmp_path), "--json", "out.json", "--only", "a b", f"--data={tmp_path}"]
    monkeypatch.setattr(sys, "argv", ["command", *words])
    path = tmp_path / "out.json"
    written = results.Results(path)
    for title in ("first", "second"):
        written.add_table(
            ("method", "ms"), (row for row in (["gicp", "1"], ["ndt", "2"])), title=title
        )
    assert "### first\n\n| method | ms |\n| --- | --- |\n| gicp | 1 |" in capsys.readouterr().out
    found = json.loads(path.read_text())
    assert found["command"].endswith("--data FOLDER --only 'a b' --data FOLDER")
    assert set(found["machine"]) == {"processor", "cores", "python", "numpy", "numba"}
    assert {"commit", "dirty", "date"} < set(found)
    assert [table["title"] for table in found["tables"]] == ["first", "second"]
    assert found["tables"][0] == {
        "title": "first",
        "columns": ["method", "ms"],
        "rows": [["gicp", "1"], ["ndt", "2"]],
    }


def test_the_page_of_results_matches_the_results_files(root_on_path):
    report = importlib.import_module("benchmarks.report")
    page = _ROOT / "docs" / "benchmarks.md"
    text = page.read_text(encoding="utf-8")
    assert report.updated(text, _FOLDER / "results") == text, (
        "docs/benchmarks.md is out of date; run python -m benchmarks.report benchmarks/results"
    )
    assert set(re.findall(r"<!-- table: (\S+) -->", text)) == set(report.SECTIONS)


def test_files_and_commands_named_in_texts_exist():
    texts = [*_ROOT.glob("*.md"), *_ROOT.glob("docs/**/*.md"), *_ROOT.glob("src/**/*.py")]
    named = {
        name
        for path in texts
        for name in re.findall(
            r"\bbenchmarks/[\w/]+\.\w+|-m\s+benchmarks(?:\.\w+)+", path.read_text(encoding="utf-8")
        )
    }
    assert len(named) > 20
    for name in named:
        module = name.removeprefix("-m").strip()
        path = module if "/" in module else f"{module.replace('.', '/')}.py"
        assert (_ROOT / path).is_file(), name


@pytest.mark.slow
@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_the_guard_times_stages_and_warns_of_slow_ones(tmp_path):
    recorded = tomllib.loads((_FOLDER / "speed" / "guard.toml").read_text())["multiples"]
    slow = "sgc-ndt-d2d, align"
    recorded_multiples = {name: 1e9 for name in recorded} | {slow: 1e-9}
    lines = [f'"{name}" = {multiple}' for name, multiple in recorded_multiples.items()]
    (tmp_path / "recorded.toml").write_text("\n".join(["[multiples]", *lines]))
    done = subprocess.run(
        [
            sys.executable, "-W", "error", "-m", "benchmarks.speed.guard", "--rounds", "1",
            "--only", "sgc-ndt-d2d", "--baseline", tmp_path / "recorded.toml",
            "--json", tmp_path / "guard.json",
        ],
        env=os.environ, cwd=_ROOT, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"^warning: (.*) takes more", done.stdout, re.MULTILINE) == [slow]
    stages = re.findall(r"^\| ([^|]+) \| \d+\.\d\d \|", done.stdout, re.MULTILINE)
    assert stages == [name for name in recorded if "sgc-ndt-d2d" in name] != []
    written = json.loads((tmp_path / "guard.json").read_text())
    assert written["command"].startswith("python -m benchmarks.speed.guard --rounds 1")
    assert [row[0] for row in written["tables"][0]["rows"]] == stages
