"""Where the command line begins and ends, whatever interrupts it."""

from collections.abc import Sequence

from scanlock.cli.interrupts import exit_code, interrupts_raised


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    arguments : sequence of str, optional
        What follows the name of the program; ``sys.argv`` by default.

    Returns
    -------
    int
        0 done; 1 wrong arguments or files, told in one line on stderr; 2 a registration that is
        not to be trusted; 130 interrupted, 143 asked to end, 129 left by its terminal; 141 the
        reader of the output went away.
    """
    try:
        with interrupts_raised():
            # Imported here, since even that takes long enough to be interrupted.
            from scanlock.cli.app import run

            return run(arguments)
    except KeyboardInterrupt as interrupt:
        return exit_code(interrupt)
