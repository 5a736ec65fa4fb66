"""Hold a benchmark to one core, so that CPU time is work done and not threads that wait."""

import os
import sys


def hold_to_one_core() -> None:
    """Start the script again on one core, unless it has only one or the system cannot say.

    Libraries make their threads as they are loaded, for as many cores as they see; those of BLAS
    spin while they wait, and process time counts them all.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) > 1:
        os.sched_setaffinity(0, {cores[os.getpid() % len(cores)]})
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
