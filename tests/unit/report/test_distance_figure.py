import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.distance_figure import DistancePanel, distance_figure


def test_distances_are_drawn_in_scan_order():
    before, after = np.array([1.0, 3.0, 2.0]), np.array([0.1, 0.0, 0.2])
    upper, lower = distance_figure(
        [
            DistancePanel("one", {"before": before, "after": after}),
            DistancePanel("two", {"x": after}),
        ]
    ).axes
    shown = [np.asarray(line.get_ydata()) for line in upper.lines]
    np.testing.assert_array_equal(shown[0], before)
    # The logarithmic scale has a minimum.
    np.testing.assert_array_equal(shown[1], [0.1, 0.001, 0.2])
    texts = [text.get_text() for text in upper.get_legend().get_texts()]
    assert texts == ["before: mean 200.0 cm", "after: mean 10.0 cm"]
    assert (upper.get_title(), lower.get_title()) == ("one", "two")


@pytest.mark.parametrize("panels", [[], [DistancePanel("x", {})]])
def test_empty_panels_are_rejected(panels):
    with pytest.raises(InvalidInput, match="at least one panel"):
        distance_figure(panels)
