import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.evaluation.box_plot import box_plot


def test_whiskers_end_at_the_last_value_that_is_no_outlier():
    found = box_plot([1.0, 2.0, 3.0, 4.0, 5.0, 8.0, 30.0, -20.0, np.nan, np.inf])
    assert found.count == 8
    assert (found.lower_quartile, found.median, found.upper_quartile) == (1.75, 3.5, 5.75)
    # 1.5 times 4 beyond the quartiles: from -4.25 to 11.75.
    assert (found.lower_whisker, found.upper_whisker) == (1.0, 8.0)
    np.testing.assert_array_equal(found.outliers, [-20.0, 30.0])


def test_whiskers_and_median_of_one_value_coincide():
    found = box_plot([3.0])
    assert found.lower_whisker == found.median == found.upper_whisker == 3.0
    assert len(found.outliers) == 0


def test_values_without_a_finite_one_are_refused():
    with pytest.raises(InvalidInput, match="values must hold a finite number, got 2 NaN or Inf"):
        box_plot([np.nan, np.inf])
