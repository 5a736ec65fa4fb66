"""Restriction of a benchmark to some cores, so that CPU time counts work and not waiting."""

import os
import sys


def pin_to_cores(count: int = 1) -> None:
    """Restart the command on at most `count` cores, where the system supports it.

    Notes
    -----
    Libraries create their threads on import, one per visible core. Threads of BLAS spin while they
    wait, and process time counts that.
    """
    if not hasattr(os, "sched_setaffinity"):
        return
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) > count:
        first = os.getpid() % len(cores)
        os.sched_setaffinity(0, [*cores[first:], *cores[:first]][:count])
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
