"""Options of a run, kept in its output folder: another run must not be mixed with it."""

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from scanlock.errors import InvalidInput

NAME = "options.json"
"""Name of the file in the output folder."""

PAGE = "index.md"
"""Name of the page that a run writes last."""

Options = Mapping[str, str | int | float | bool | None]
"""Values by the name of an option."""


def write_options(folder: Path, options: Options) -> None:
    """Write the options of a run into its folder."""
    from scanlock.io import atomic_file

    with atomic_file(folder / NAME) as handle:
        handle.write((json.dumps(options, indent=2, allow_nan=False) + "\n").encode())


def changed_options(folder: Path, options: Options) -> list[str] | None:
    """Return the differences of the options from those of the run in a folder, in words.

    Returns
    -------
    list of str or None
        None if the folder has no options.
    """
    try:
        before = json.loads((folder / NAME).read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:
        return [f"{NAME} is not readable"]
    if not isinstance(before, dict):
        return [f"{NAME} is not readable"]
    known: dict[str, Any] = before
    return [
        f"{name} was {known.get(name)}, is {value}"
        for name, value in options.items()
        if known.get(name) != value
    ]


def require_same_page(folder: Path, options: Options, noun: str) -> None:
    """Raise `InvalidInput` if a folder has the page of a run with other options.

    Parameters
    ----------
    folder : Path
        Output folder.
    options : Options
        Options of this run.
    noun : str
        Word for the runs, such as ``"comparison"``.
    """
    if not (folder / PAGE).exists():
        return
    changes = changed_options(folder, options)
    if changes is None or changes:
        differences = "; ".join(changes or ["its options are not known"])
        raise InvalidInput(
            f"{folder} contains another {noun} ({differences}); use another folder, or "
            "--overwrite to replace its page"
        )


def digest(*parts: object) -> str:
    """Return a short digest of values with the same `repr` in every run."""
    return hashlib.sha256("\n".join(map(repr, parts)).encode()).hexdigest()[:16]
