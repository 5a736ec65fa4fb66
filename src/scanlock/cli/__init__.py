"""The command line: one file a command; parse, call, print."""

from scanlock.cli.app import main

__all__ = ["main"]
