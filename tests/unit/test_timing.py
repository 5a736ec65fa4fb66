import pytest

from scanlock.timing import StageClock


def test_a_clock_sums_the_time_of_each_stage():
    clock = StageClock()
    for _ in range(2):
        with clock.stage("one"):
            pass
    first = clock.seconds["one"]
    with pytest.raises(ZeroDivisionError), clock.stage("one"):
        _ = 1 / 0
    assert clock.seconds["one"] > first > 0.0
