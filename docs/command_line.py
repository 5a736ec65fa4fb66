"""Write the page of the command line from the help of every command.

Run from the root of the repository: ``python docs/command_line.py > docs/command-line.md``.
"""

import contextlib
import io
import os
from collections.abc import Iterator

from scanlock.cli import main
from scanlock.cli.command_table import COMMANDS

_HEAD = """\
# Command line

`scanlock COMMAND --help` prints the same. Exit codes: 0 for a verified pose or finished work, 1 for
a mistake in the call or a file, 2 for a pose that is not verified.
"""


def page() -> str:
    """Return the page: one section for each command."""
    sections = [f"## {name}\n\n```text\n{_help(name)}\n```\n" for name in COMMANDS]
    return "\n".join([_HEAD, *sections])


def _help(name: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out), _width(100):
        main([name, "--help"])
    return "\n".join(line.rstrip() for line in out.getvalue().strip().splitlines())


@contextlib.contextmanager
def _width(columns: int) -> Iterator[None]:
    before = os.environ.get("COLUMNS")
    os.environ["COLUMNS"] = str(columns)
    try:
        yield
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before


if __name__ == "__main__":
    print(page(), end="")
