"""The benchmark that watches the times runs, and says what became slower."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numba
import pytest

_FOLDER = Path(__file__).resolve().parents[2] / "benchmarks"

pytestmark = pytest.mark.skipif(
    numba.config.DISABLE_JIT or not _FOLDER.is_dir(), reason="needs a compiler and the benchmarks"
)


def test_the_guard_measures_stages_and_warns_of_the_slower(tmp_path):
    kept = tomllib.loads((_FOLDER / "guard.toml").read_text())["multiples"]
    slow = "sgc-ndt-d2d, align"
    never = {name: 1e9 for name in kept} | {slow: 1e-9}
    lines = [f'"{name}" = {multiple}' for name, multiple in never.items()]
    (tmp_path / "kept.toml").write_text("\n".join(["[multiples]", *lines]))
    done = subprocess.run(
        [
            sys.executable, "-W", "error", _FOLDER / "guard.py", "--rounds", "1", "--only",
            "sgc-ndt-d2d", "--kept", tmp_path / "kept.toml",
        ],
        env=os.environ, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert re.findall(r"^warning: (.*) takes more", done.stdout, re.MULTILINE) == [slow]
    stages = re.findall(r"^\| ([^|]+) \| \d+\.\d\d \|", done.stdout, re.MULTILINE)
    assert stages == [name for name in kept if "sgc-ndt-d2d" in name] != []
