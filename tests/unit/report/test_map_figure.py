import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.canvas import VERMILION
from scanlock.report.map_figure import DrawnMap, map_figure

RNG = np.random.default_rng(0)


def _column(x, y, count=2000, width=0.05):
    noise = RNG.normal(0.0, width, (count, 2))
    return np.column_stack([x + noise[:, 0], y + noise[:, 1], RNG.uniform(0.0, 3.0, count)])


def _drawn(width=0.05, caption=""):
    spots = [(10.0, 3.0), (11.0, 4.0), (-30.0, 2.0), (30.0, -5.0), (0.0, 30.0)]
    points = np.concatenate([_column(x, y, width=width) for x, y in spots])
    path = np.column_stack([np.linspace(-40.0, 40.0, 30), np.zeros((30, 2))])
    return DrawnMap(points, path, caption)


def test_all_maps_share_their_windows():
    figure = map_figure({"a": _drawn(), "b": _drawn(0.3)})
    whole, other, close, closer = figure.axes
    assert whole.get_xlim() == other.get_xlim()
    assert close.get_xlim() == closer.get_xlim()
    [rectangle] = whole.patches
    assert close.get_xlim() == pytest.approx(
        (rectangle.get_x(), rectangle.get_x() + rectangle.get_width())
    )
    assert close.get_ylim() == pytest.approx(
        (rectangle.get_y(), rectangle.get_y() + rectangle.get_height())
    )


def test_the_window_includes_a_map_that_is_elsewhere():
    true, away = _drawn(), np.array([200.0, 0.0, 0.0])
    strayed = DrawnMap(true.points + away, true.path + away)
    whole, other, close, _ = map_figure({"true": true, "strayed": strayed}).axes
    for axes in (whole, other):
        left, right = axes.get_xlim()
        assert left < -30.0
        assert right > 230.0
        assert np.asarray(axes.images[0].get_array()).max() > 0.0
    # The close-up is chosen on the first map.
    left, right = close.get_xlim()
    assert left < 10.0 < 11.0 < right


def test_the_close_up_has_the_most_objects_near_the_path():
    close = map_figure({"a": _drawn()}).axes[1]
    left, right = close.get_xlim()
    assert left < 10.0 < 11.0 < right


def test_every_point_in_the_window_is_counted():
    drawn = _drawn()
    whole = map_figure({"a": drawn}).axes[0]
    image = np.asarray(whole.images[0].get_array())
    x, y = whole.get_xlim(), whole.get_ylim()
    inside = (drawn.points[:, 0] > x[0]) & (drawn.points[:, 0] < x[1])
    inside &= (drawn.points[:, 1] > y[0]) & (drawn.points[:, 1] < y[1])
    counts = np.expm1(image)
    assert 0.5 * inside.sum() < counts.sum() <= inside.sum() + 1e-6
    # Rows increase with y, so y = 30 is in the upper half of the image.
    row = int((30.0 - y[0]) / (y[1] - y[0]) * len(image))
    column = int((0.0 - x[0]) / (x[1] - x[0]) * len(image))
    assert image[row - 2 : row + 3, column - 2 : column + 3].max() > 0.0


def test_a_blurred_map_is_paler_in_the_close_up():
    figure = map_figure({"a": _drawn(0.02), "b": _drawn(0.5)})
    crisp, smeared = (np.asarray(axes.images[0].get_array()) for axes in figure.axes[2:])
    assert (smeared > 0.0).sum() > 2 * (crisp > 0.0).sum()


def test_the_path_and_the_caption_are_shown():
    figure = map_figure({"a": _drawn(caption="crispness 12")}, title="the forest")
    whole = figure.axes[0]
    assert whole.get_title() == "a\ncrispness 12"
    assert whole.lines[0].get_color() == VERMILION
    assert figure._suptitle.get_text() == "the forest"


def test_five_maps_take_two_rows_of_pairs():
    figure = map_figure(dict.fromkeys("abcde", _drawn()))
    assert len(figure.axes) == 12
    assert sum(axes.axison for axes in figure.axes) == 10


@pytest.mark.parametrize("maps", [{}, {"a": DrawnMap(np.zeros((0, 3)), np.zeros((1, 3)))}])
def test_empty_maps_are_rejected(maps):
    with pytest.raises(InvalidInput, match="needs at least one map"):
        map_figure(maps)
