import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.reliability_figure import reliability_figure

_EDGES = (0.0, 0.5, 1.0)


def test_each_bin_is_drawn_at_its_mean_and_its_frequency():
    probabilities = np.array([0.1, 0.3, 0.8, 1.0])
    outcomes = np.array([False, True, True, True])
    curve, counts = reliability_figure(probabilities, outcomes, _EDGES).axes
    points = curve.lines[1].get_xydata()
    np.testing.assert_allclose(points, [[0.2, 0.5], [0.9, 1.0]])
    assert len(counts.patches) > 0


@pytest.mark.parametrize("lengths", [(0, 0), (2, 3)])
def test_arrays_of_different_length_are_rejected(lengths):
    with pytest.raises(InvalidInput, match="the same length"):
        reliability_figure(np.zeros(lengths[0]), np.zeros(lengths[1], bool), _EDGES)
