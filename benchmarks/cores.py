"""Hold a benchmark to some cores, so that CPU time is work done and not threads that wait."""

import os
import sys


def hold_to_cores(count: int = 1) -> None:
    """Start the script again on so many cores, unless it has no more or the system cannot say.

    Libraries make their threads as they are loaded, for as many cores as they see; those of BLAS
    spin while they wait, and process time counts them all.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) > count:
        first = os.getpid() % len(cores)
        os.sched_setaffinity(0, [*cores[first:], *cores[:first]][:count])
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
