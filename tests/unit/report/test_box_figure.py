import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.box_figure import BoxPanel, box_figure


def _lines(axes):
    return [np.asarray(line.get_ydata()) for line in axes.lines]


def test_boxes_and_whiskers_are_those_of_the_paper():
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 12.0, 40.0]) / 10.0
    [axes] = box_figure([BoxPanel("error [m]", {"icp": values})]).axes
    lower, upper = np.percentile(values, [25.0, 75.0])
    [box] = axes.patches
    assert (box.get_y(), box.get_y() + box.get_height()) == pytest.approx((lower, upper))
    reach = upper + 1.5 * (upper - lower)
    last = values[values <= reach].max()
    ends = np.concatenate(_lines(axes))
    assert last in ends
    # The one value beyond is a dot of its own.
    assert any(line.tolist() == [4.0] for line in _lines(axes))


def test_values_that_are_not_there_are_counted_and_not_drawn():
    panel = BoxPanel("error", {"a": np.array([0.1, np.nan, 0.2]), "b": np.full(2, np.nan)})
    [axes] = box_figure([panel]).axes
    assert [tick.get_text() for tick in axes.get_xticklabels()] == [
        "a\n(1 failed)",
        "b\n(2 failed)",
    ]


@pytest.mark.parametrize(("most", "scale"), [(0.5, "linear"), (50.0, "log")])
def test_errors_over_decades_get_a_scale_of_decades(most, scale):
    values = np.linspace(0.1, most, 20)
    left, right = box_figure([BoxPanel("x", {"a": values})] * 2).axes
    assert left.get_yscale() == right.get_yscale() == scale


@pytest.mark.parametrize("panels", [[], [BoxPanel("x", {})]])
def test_nothing_makes_no_figure(panels):
    with pytest.raises(InvalidInput, match="needs a panel"):
        box_figure(panels)
