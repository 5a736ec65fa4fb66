"""Readers of scans for lists of pairs, importable by worker processes."""

import os
import time

import numpy as np


def read_or_die(path):
    """Read a scan; end the process at a file named killer."""
    if path.stem == "killer":
        os._exit(3)
    return np.load(path)


def read_slowly(path):
    """Read a scan in a tenth of a second."""
    time.sleep(0.1)
    return np.load(path)
