import os
import subprocess
import sys
from typing import get_args

import pytest

from scanlock import __version__
from scanlock.cli import option_types as choices
from scanlock.cli.command_table import COMMANDS


def _python(code, **options):
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=False,
        **options,
    )


@pytest.mark.slow
def test_help_imports_no_numerical_packages():
    heavy = ["numpy", "numba", "scipy", "matplotlib", "laspy"]
    code = f"""
import contextlib, io, sys
from scanlock.cli import main
for name in {list(COMMANDS)}:
    with contextlib.redirect_stdout(io.StringIO()) as out:
        assert main([name, "--help"]) == 0
    assert "Usage: scanlock " + name in out.getvalue()
print([m for m in {heavy} if m in sys.modules])
"""
    done = _python(code)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_no_arguments_print_help(scanlock):
    done = scanlock()
    assert (done.code, done.err) == (0, "")
    assert all(f"\n  {name} " in done.out for name in COMMANDS)


def test_help_lists_the_commands_in_their_order(scanlock):
    out = scanlock("--help").out
    positions = [out.index(f"\n  {name} ") for name in COMMANDS]
    assert positions == sorted(positions)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_line_of_help_fits_80_columns(scanlock, command):
    done = scanlock(command, "--help")
    assert done.code == 0
    assert max(map(len, done.out.splitlines())) <= 80


def test_an_unknown_command_lists_some_commands(scanlock):
    done = scanlock("nothing")
    assert done.code == 1
    assert ", ...; see `scanlock --help`" in done.err


@pytest.mark.parametrize("command", COMMANDS)
def test_examples_of_help_are_commands_that_parse(command):
    from scanlock.cli.app import build_app

    lines = COMMANDS[command].epilogue.splitlines()
    examples = [line.strip() for line in lines if line.startswith("  scanlock ")]
    for example in examples:
        function, _, _ = build_app().parse_args(
            example.removeprefix("scanlock "), exit_on_error=False, print_error=False
        )
        assert f"{function.__module__}:{function.__name__}" == COMMANDS[command].path


def test_the_version_is_printed(scanlock):
    assert scanlock("--version").out == f"scanlock {__version__}\n"


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["regster", "a", "b"], ["regster", "register", "scanlock --help"]),
        (["register", "a"], ["TARGET", "scanlock register --help"]),
        (["register", "a", "b", "--metod", "x"], ["--metod", "--method"]),
        (["register", "a", "b", "--method", "sgc-ndt-d3d"], ["sgc-ndt-d2d", "sgc-ndt-p2d"]),
        (["register", "a", "b", "c"], ["c"]),
        (["info", "a", "--format", "pdc"], ["pdc", "las", "Did you mean", "pcd"]),
        (["simulate", "forst", "-o", "a"], ["forst", "street", "forest"]),
        (["simulate", "street", "-o", "a", "--scans", "many"], ["many", "--scans"]),
    ],
)
def test_a_typo_is_one_line_on_stderr_with_a_remedy(scanlock, arguments, parts):
    done = scanlock(*arguments)
    assert (done.code, done.out) == (1, "")
    assert done.err.startswith("scanlock: ")
    assert done.err.count("\n") == 1
    assert all(part in done.err for part in parts)


def test_choices_equal_the_available_names():
    from scanlock.io import FORMATS
    from scanlock.optimisation.objectives.constraints import DegreesOfFreedom
    from scanlock.registration.registry import DEFAULT_METHOD, METHODS
    from scanlock.registration.uncertainty.pose_covariance import CovarianceMethod
    from scanlock.simulation import SCENES, SENSORS

    assert get_args(choices.DofName) == get_args(DegreesOfFreedom)
    assert get_args(choices.CovarianceName) == (*get_args(CovarianceMethod), "none")
    assert get_args(choices.FormatName) == tuple(FORMATS)
    assert get_args(choices.SceneName) == tuple(SCENES)
    assert [name.replace("-", "_") for name in get_args(choices.SensorName)] == list(SENSORS)

    assert DEFAULT_METHOD in METHODS


def test_an_interrupt_prints_nothing(scanlock, monkeypatch, scans):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("scanlock.io.describe_scan", interrupted)
    done = scanlock("info", scans / "target.npy")
    assert (done.code, done.out, done.err) == (130, "", "")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="pipes behave differently on Windows")
@pytest.mark.parametrize("option", [[], ["--json"]])
def test_a_closed_pipe_is_not_an_error(scans, option):
    reading, writing = os.pipe()
    os.close(reading)
    code = "import sys; from scanlock.cli import main; sys.exit(main())"
    arguments = ["info", str(scans / "target.npy"), *option]
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, *arguments],
        stdout=writing,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    os.close(writing)
    assert (done.returncode, done.stderr) == (141, "")


@pytest.mark.slow
def test_names_outside_the_encoding_of_the_terminal_are_escaped(tmp_path, scans):
    path = tmp_path / "straße.npy"
    path.write_bytes((scans / "target.npy").read_bytes())
    code = "import sys; from scanlock.cli import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, "info", str(path)],
        env=os.environ | {"PYTHONIOENCODING": "ascii"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "stra\\xdfe.npy" in done.stdout


def test_an_unexpected_error_keeps_its_traceback(scanlock, monkeypatch, scans):
    def broken(*_, **__):
        raise RuntimeError("a mistake")

    monkeypatch.setattr("scanlock.io.describe_scan", broken)
    with pytest.raises(RuntimeError, match="a mistake"):
        scanlock("info", scans / "target.npy")
