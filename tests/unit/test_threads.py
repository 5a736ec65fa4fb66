import multiprocessing
import threading
import time

import pytest

from scanlock.errors import InvalidInput
from scanlock.threads import spread, using_threads


def _square(number):
    return number * number


@pytest.mark.parametrize("threads", [1, 2, 3, 16])
@pytest.mark.parametrize("items", [0, 1, 2, 5, 40])
def test_results_come_in_the_order_of_the_items(threads, items):
    with using_threads(threads):
        assert spread(_square, range(items)) == [k * k for k in range(items)]


def test_work_is_shared_by_as_many_threads_as_are_allowed():
    meeting = threading.Barrier(3, timeout=20.0)

    def meet(_):
        meeting.wait()
        return threading.get_ident()

    with using_threads(3):
        assert len(set(spread(meet, range(3)))) == 3
    assert set(spread(lambda _: threading.get_ident(), range(3))) == {threading.get_ident()}


def test_nothing_is_spread_again_from_inside():
    def inner(_):
        return threading.get_ident()

    def outer(_):
        return set(spread(inner, range(5))) == {threading.get_ident()}

    with using_threads(2):
        assert all(spread(outer, range(6)))
        # And afterwards the caller may spread as before.
        assert spread(_square, range(3)) == [0, 1, 4]


def test_another_thread_starts_with_one():
    seen = []

    def alone():
        seen.append(set(spread(lambda _: threading.get_ident(), range(4))))
        seen.append({threading.get_ident()})

    with using_threads(4):
        thread = threading.Thread(target=alone)
        thread.start()
        thread.join()
    assert seen[0] == seen[1]


def test_an_error_is_raised_once_all_have_ended():
    ended = []

    def work(number):
        if number == 1:
            raise ValueError("one is wrong")
        time.sleep(0.05)
        ended.append(number)

    for threads in (1, 2):
        with using_threads(threads), pytest.raises(ValueError, match="one is wrong"):
            spread(work, range(2))
    assert ended == [0, 0]


@pytest.mark.parametrize("count", [0, -1, 1.5])
def test_numbers_of_threads_out_of_range_are_refused(count):
    with pytest.raises(InvalidInput, match="threads must be"), using_threads(count):
        pass


def _spread_in_a_child(queue):
    with using_threads(2):
        queue.put(spread(_square, range(10)))


@pytest.mark.skipif(
    "fork" not in multiprocessing.get_all_start_methods(), reason="this system cannot fork"
)
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_starts_threads_of_its_own():
    with using_threads(2):
        spread(_square, range(10))
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    child = context.Process(target=_spread_in_a_child, args=(queue,))
    child.start()
    assert queue.get(timeout=30.0) == [k * k for k in range(10)]
    child.join(timeout=30.0)
    assert child.exitcode == 0
