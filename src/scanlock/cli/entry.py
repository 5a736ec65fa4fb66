"""Entry point of the command line."""

from collections.abc import Sequence

from scanlock.cli.interrupts import exit_code, interrupts_raised


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        Arguments after the program name; ``sys.argv`` by default.

    Returns
    -------
    int
        0 success; 1 wrong arguments or files, with one line on stderr; 2 a pose that is not
        verified; 130 SIGINT, 143 SIGTERM, 129 SIGHUP; 141 closed output pipe.
    """
    try:
        with interrupts_raised():
            # Imported here, since the import takes long enough to be interrupted.
            from scanlock.cli.app import run

            return run(arguments)
    except KeyboardInterrupt as interrupt:
        return exit_code(interrupt)
