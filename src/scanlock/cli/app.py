"""The commands, and what becomes of their answers and errors.

Only Cyclopts is imported here, and a command's own file only when it is asked for: help must
come at once, and NumPy, SciPy and Numba take seconds.
"""

import io
import os
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from scanlock import __version__
from scanlock.cli.command_table import COMMANDS
from scanlock.cli.errors import complain, one_line, usage_fault
from scanlock.errors import ScanlockError

OK, FAULT, PIPE_CLOSED = 0, 1, 141
"""Exit codes; the last is 128 and the number of the signal, as shells have it."""

_EPILOGUE = """\
Examples:
  scanlock demo
  scanlock register reference.bin scene.bin -o pose.txt
  scanlock COMMAND --help
"""


def build_app() -> App:
    """Return the parser of the command line; a command is imported once it is asked for."""
    app = App(
        name="scanlock",
        help="Lock 3D lidar scans together: fast, from far starts, and honest about failure.",
        version=f"scanlock {__version__}",
        # Markdown would take a quarter of a second to import.
        help_format="plaintext",
        help_formatter="default" if sys.stdout.isatty() else "plain",
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
            None if arguments is None else list(arguments),
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


def _accept_any_name() -> None:
    # Names of files hold what a terminal's encoding may lack; printing them must not fail.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _forget_stdout() -> None:
    # Python flushes stdout once more on its way out, and would complain about the closed pipe.
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
