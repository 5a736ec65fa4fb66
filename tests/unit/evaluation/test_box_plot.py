import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.box_plot import spread


def test_whiskers_end_at_the_last_value_within_their_reach():
    found = spread([1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 30.0, -20.0, np.nan, np.inf])
    assert found.count == 8
    assert (found.lower, found.median, found.upper) == (1.75, 3.5, 5.75)
    # 1.5 times 4 beyond the quartiles: from -4.25 to 11.75.
    assert (found.low, found.high) == (1.0, 8.0)
    np.testing.assert_array_equal(found.outliers, [-20.0, 30.0])


def test_one_value_is_its_own_spread():
    found = spread([3.0])
    assert found.low == found.median == found.high == 3.0
    assert len(found.outliers) == 0


def test_nothing_has_no_spread():
    with pytest.raises(InvalidInput, match="values must hold a finite number, got 2 others"):
        spread([np.nan, np.inf])
