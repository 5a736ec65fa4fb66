import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.basin_figure import Basin, basin_figure

SOLVED = np.array([[5, 4, 0], [3, 0, 0]])
BASIN = Basin(SOLVED, np.full((2, 3), 5))


def test_each_cell_shows_its_ratio_and_its_counts():
    figure = basin_figure({"a": BASIN, "b": BASIN}, [1.0, 4.0], [0.0, 10.0, 40.0])
    axes = figure.axes[0]
    [image] = axes.images
    np.testing.assert_allclose(image.get_array(), SOLVED / 5)
    assert {text.get_text() for text in axes.texts} == {"5/5", "4/5", "0/5", "3/5"}
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["1", "4"]
    assert [axes.get_title() for axes in figure.axes] == ["a", "b"]


def test_unused_axes_are_hidden():
    figure = basin_figure(dict.fromkeys("abcd", BASIN), [1.0, 4.0], [0.0, 10.0, 40.0])
    assert [axes.axison for axes in figure.axes] == [True] * 4 + [False] * 2


def test_cells_without_starts_are_empty():
    basin = Basin(np.zeros((1, 1), int), np.zeros((1, 1), int))
    axes = basin_figure({"a": basin}, [1.0], [0.0]).axes[0]
    assert np.ma.filled(axes.images[0].get_array(), np.nan).tolist() == [
        [pytest.approx(np.nan, nan_ok=True)]
    ]


def test_shapes_must_agree():
    with pytest.raises(InvalidInput, match="the same shape"):
        Basin(SOLVED, SOLVED[:1])
    with pytest.raises(InvalidInput, match=r"basins must have shape \(1, 3\)"):
        basin_figure({"a": BASIN}, [1.0], [0.0, 10.0, 40.0])
    with pytest.raises(InvalidInput, match="one basin per method"):
        basin_figure({}, [1.0], [0.0])
