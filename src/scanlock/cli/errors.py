"""Errors as one line on stderr, with a remedy."""

import difflib
import os
from collections.abc import Sequence
from pathlib import Path

from cyclopts import CycloptsError

from scanlock.cli.console import screen


def complain(message: str) -> None:
    """Print one line on stderr."""
    from rich.text import Text

    screen("stderr").print(Text.assemble(("scanlock: ", "bold red"), message), soft_wrap=True)


def usage_fault(error: CycloptsError) -> str:
    """Return the message of a usage error, with the help command."""
    command = " ".join(["scanlock", *(error.command_chain or ())])
    message = _joined(str(error))
    # A list that ends in three dots is a part of a longer one.
    message = message if message.endswith("...") else message.rstrip(".")
    return f"{message}; see `{command} --help`"


def one_line(error: Exception) -> str:
    """Return the message of an expected error in one line."""
    if not isinstance(error, OSError) or error.strerror is None:
        return _joined(str(error))
    text = error.strerror[:1].lower() + error.strerror[1:]
    if error.filename is None:
        return text
    path = os.fspath(error.filename)
    return _joined(f"{path}: {text}{_remedy(error, path)}")


def nearest(word: str, choices: Sequence[str]) -> str:
    """Return ``"; did you mean X?"`` for the closest choice, or an empty string."""
    found = difflib.get_close_matches(word, choices, n=1)
    return f"; did you mean {found[0]}?" if found else ""


def _remedy(error: OSError, path: str) -> str:
    if isinstance(error, FileNotFoundError):
        return nearest(Path(path).name, _neighbours(path))
    if isinstance(error, PermissionError):
        return "; check its permissions"
    return ""


def _neighbours(path: str) -> list[str]:
    try:
        return sorted(os.listdir(Path(path).parent))
    except OSError:
        return []


def _joined(text: str) -> str:
    return " ".join(text.split())
