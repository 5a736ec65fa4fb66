import multiprocessing
import threading
import time

import pytest

from scanlock.errors import InvalidInput
from scanlock.threads import parallel_map, using_threads


def _square(number):
    return number * number


@pytest.mark.parametrize("threads", [1, 2, 3, 16])
@pytest.mark.parametrize("items", [0, 1, 2, 5, 40])
def test_results_are_in_the_order_of_the_items(threads, items):
    with using_threads(threads):
        assert parallel_map(_square, range(items)) == [k * k for k in range(items)]


def test_the_map_uses_all_threads_that_are_allowed():
    barrier = threading.Barrier(3, timeout=20.0)

    def wait(_):
        barrier.wait()
        return threading.get_ident()

    with using_threads(3):
        assert len(set(parallel_map(wait, range(3)))) == 3
    assert set(parallel_map(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}


def test_nested_maps_run_in_one_thread():
    def inner(_):
        return threading.get_ident()

    def outer(_):
        return set(parallel_map(inner, range(5))) == {threading.get_ident()}

    with using_threads(2):
        assert all(parallel_map(outer, range(6)))
        # The caller's own threads are available again.
        assert parallel_map(_square, range(3)) == [0, 1, 4]


def test_a_new_thread_starts_with_one_thread():
    seen = []

    def alone():
        seen.append(set(parallel_map(lambda _: threading.get_ident(), range(4))))
        seen.append({threading.get_ident()})

    with using_threads(4):
        thread = threading.Thread(target=alone)
        thread.start()
        thread.join()
    assert seen[0] == seen[1]


def test_an_error_is_raised_after_all_threads_have_ended():
    ended = []

    def work(number):
        if number == 1:
            raise ValueError("one is wrong")
        time.sleep(0.05)
        ended.append(number)

    for threads in (1, 2):
        with using_threads(threads), pytest.raises(ValueError, match="one is wrong"):
            parallel_map(work, range(2))
    assert ended == [0, 0]


@pytest.mark.parametrize("count", [0, -1, 1.5])
def test_invalid_numbers_of_threads_are_rejected(count):
    with pytest.raises(InvalidInput, match="threads must be"), using_threads(count):
        pass


def _map_in_a_child(queue):
    with using_threads(2):
        queue.put(parallel_map(_square, range(10)))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_starts_its_own_threads():
    with using_threads(2):
        parallel_map(_square, range(10))
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_map_in_a_child, args=(queue,))
    child.start()
    assert queue.get(timeout=30.0) == [k * k for k in range(10)]
    child.join(timeout=30.0)
    assert child.exitcode == 0
