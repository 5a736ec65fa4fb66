"""Hundreds of concurrent calls: results identical to one call, and constant memory."""

import gc
import multiprocessing
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from contracts.traits import source, target
from reference.pairs import register_pair
from reference.samples import street
from scanlock.registration.register import register

pytestmark = pytest.mark.stress

_METHODS = ("auto", "sgc-ndt-d2d", "gicp", "icp", "ndt")


def _result_bytes(method):
    found = register(source=source(method), target=target(), method=method)
    numbers = np.array([*astuple(found.metrics), found.probability])
    return found.target_from_source.matrix.tobytes() + numbers.tobytes()


def test_a_hundred_threads_give_identical_results():
    alone = {method: _result_bytes(method) for method in _METHODS}
    jobs = [_METHODS[k % len(_METHODS)] for k in range(100)]
    with ThreadPoolExecutor(100) as pool:
        for method, found in zip(jobs, pool.map(_result_bytes, jobs), strict=True):
            assert found == alone[method]


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_eight_processes_give_identical_results():
    alone = {method: _result_bytes(method) for method in _METHODS}
    jobs = [_METHODS[k % len(_METHODS)] for k in range(80)]
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(8, mp_context=context) as pool:
        for method, found in zip(jobs, pool.map(_result_bytes, jobs), strict=True):
            assert found == alone[method]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_does_not_grow_over_hundreds_of_registrations():
    scans = street(1, 3000), street(2, 3000)

    def used_after(count):
        for _ in range(count):
            register_pair(scans)
        gc.collect()
        return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

    before = used_after(50)
    # A leak of one scan per call would be 36 times as much.
    assert used_after(150) - before < 150 * 2000
