import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.box_figure import BoxPanel, box_figure


def _lines(axes):
    return [np.asarray(line.get_ydata()) for line in axes.lines]


def test_boxes_span_the_quartiles_and_whiskers_end_within_1_5_times_that():
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 12.0, 40.0]) / 10.0
    [axes] = box_figure([BoxPanel("error [m]", {"icp": values})]).axes
    lower, upper = np.percentile(values, [25.0, 75.0])
    [box] = axes.patches
    assert (box.get_y(), box.get_y() + box.get_height()) == pytest.approx((lower, upper))
    fence = upper + 1.5 * (upper - lower)
    last = values[values <= fence].max()
    ends = np.concatenate(_lines(axes))
    assert last in ends
    # The one value beyond is drawn as a point.
    assert any(line.tolist() == [4.0] for line in _lines(axes))


def test_missing_values_are_counted_and_not_drawn():
    panel = BoxPanel("error", {"a": np.array([0.1, np.nan, 0.2]), "b": np.full(2, np.nan)})
    [axes] = box_figure([panel]).axes
    assert [tick.get_text() for tick in axes.get_xticklabels()] == [
        "a\n(1 failed)",
        "b\n(2 failed)",
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("largest", "scale"), [(0.5, "linear"), (50.0, "log")])
def test_values_over_a_decade_get_a_logarithmic_scale(largest, scale):
    values = np.linspace(0.1, largest, 20)
    left, right = box_figure([BoxPanel("x", {"a": values})] * 2).axes
    assert left.get_yscale() == right.get_yscale() == scale


@pytest.mark.parametrize("panels", [[], [BoxPanel("x", {})]])
def test_empty_panels_are_rejected(panels):
    with pytest.raises(InvalidInput, match="at least one panel"):
        box_figure(panels)
