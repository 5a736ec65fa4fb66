"""The command line: one file a command; parse, call, print."""

from scanlock.cli.entry import main

__all__ = ["main"]
