"""The command-line application: parse, run a command, report its errors.

Only Cyclopts is imported here, and the file of a command only when it runs: help must print at
once, and NumPy, SciPy and Numba take seconds to import.
"""

import io
import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from scanlock import __version__
from scanlock.cli.command_table import COMMANDS
from scanlock.cli.errors import complain, one_line, usage_fault
from scanlock.cli.help_text import ColumnFormatter
from scanlock.errors import ScanlockError

OK, FAULT, PIPE_CLOSED = 0, 1, 141
"""Exit codes; the last is 128 plus the number of the signal, as in shells."""

_EPILOGUE = """\
Examples:
  scanlock demo
  scanlock register source.bin target.bin -o pose.txt
  scanlock COMMAND --help
"""


def build_app() -> App:
    """Build the parser of the command line."""
    app = App(
        name="scanlock",
        help="Register 3D lidar scans: fast, without an initial pose, with a verified result.",
        version=f"scanlock {__version__}",
        # Markdown would take a quarter of a second to import.
        help_format="plaintext",
        help_formatter=ColumnFormatter(),
        help_epilogue=_EPILOGUE,
        suppress_keyboard_interrupt=False,
    )
    for order, (name, command) in enumerate(COMMANDS.items()):
        app.command(
            command.path,
            name=name,
            help=command.help,
            help_epilogue=command.epilogue,
            sort_key=order,
        )
    return app


def run(arguments: Sequence[str] | None) -> int:
    """Run a command and return the exit code; see `scanlock.cli.entry.main`."""
    _accept_any_name()
    try:
        code = build_app()(
            _forwarded(sys.argv[1:] if arguments is None else arguments),
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
        sys.stdout.flush()
    except CycloptsError as error:
        complain(usage_fault(error))
    except BrokenPipeError:
        _forget_stdout()
        return PIPE_CLOSED
    except (ScanlockError, OSError) as error:
        complain(one_line(error))
    else:
        return code if isinstance(code, int) else OK
    return FAULT


def _forwarded(arguments: Sequence[str]) -> list[str]:
    """Return the arguments with ``register --pairs LIST`` as ``register-many LIST``."""
    words = list(arguments)
    if words[:1] != ["register"]:
        return words
    for k, word in enumerate(words):
        if word == "--pairs":
            return ["register-many", *words[1:k], *words[k + 1 :]]
        if word.startswith("--pairs="):
            return ["register-many", *words[1:k], word.removeprefix("--pairs="), *words[k + 1 :]]
    return words


def _accept_any_name() -> None:
    # File names may hold characters that the terminal's encoding lacks; printing must not fail.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _forget_stdout() -> None:
    # Python flushes stdout once more at exit, and would report the closed pipe.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
