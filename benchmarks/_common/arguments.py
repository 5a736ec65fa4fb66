"""Command line arguments that all benchmarks share."""

import argparse
import os
import sys
from pathlib import Path


def make_parser(doc: str | None, *, data: bool = False) -> argparse.ArgumentParser:
    """Return a parser with ``--json`` and, on request, a required ``--data``.

    Parameters
    ----------
    doc : str
        Docstring of the benchmark; its first line is the description.
    data : bool
        Whether the benchmark reads real scans.
    """
    description = (doc or "").split("\n", maxsplit=1)[0]
    parser = argparse.ArgumentParser(prog=program_name(), description=description)
    parser.add_argument(
        "--json", type=Path, metavar="FILE", help="write the tables, the commit and the machine"
    )
    if data:
        add_data(parser, required=True)
    return parser


def add_data(parser: argparse.ArgumentParser, *, required: bool) -> None:
    """Add ``--data`` with the environment variable SCANLOCK_DATA as default."""
    default = os.environ.get("SCANLOCK_DATA")
    parser.add_argument(
        "--data", type=Path, metavar="FOLDER", default=default,
        required=required and default is None,
        help="folder of the real scans (default: $SCANLOCK_DATA)",
    )  # fmt: skip


def program_name() -> str:
    """Return the command that started this process, without its arguments."""
    spec = getattr(sys.modules.get("__main__"), "__spec__", None)
    return Path(sys.argv[0]).name if spec is None else f"python -m {spec.name}"
