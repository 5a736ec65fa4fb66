"""The command line: parse arguments, call the library, print.

The commands are in `scanlock.cli.commands`; this folder holds what they have in common: the table
of commands, option types, input, output and errors. Computations belong to the library.
"""

from scanlock.cli.entry import main

__all__ = ["main"]
