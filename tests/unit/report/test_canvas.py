import sys

import numpy as np
import pytest

from scanlock.errors import InvalidInput, MissingExtra
from scanlock.report.canvas import (
    blank_figure,
    close_up_corner,
    downsampled_rows,
    draw_frame,
    interleaved_order,
    legend_below,
    save_figure,
    scatter,
    set_map_view,
    window_around,
)


def test_a_figure_belongs_to_no_global_state():
    figure = blank_figure(4.0, 3.0)
    assert figure.get_size_inches().tolist() == [4.0, 3.0]
    assert "matplotlib.pyplot" not in sys.modules or figure.number is None


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(MissingExtra, match=r'pip install "scanlock\[figures\]"'):
        blank_figure(4.0, 3.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "start"), [("a.png", b"\x89PNG"), ("a.PDF", b"%PDF"), ("a.svg", b"<?xml")]
)
def test_the_name_decides_the_format_and_equal_figures_have_equal_bytes(tmp_path, name, start):
    contents = []
    for _ in range(2):
        figure = blank_figure(2.0, 2.0)
        scatter(figure.subplots(), np.eye(2), "black", size=3.0)
        save_figure(tmp_path / name, figure)
        contents.append((tmp_path / name).read_bytes())
    assert contents[0].startswith(start)
    assert contents[0] == contents[1]
    # Neither date nor program are in the file.
    assert b"matplotlib.org" not in contents[0]
    assert b"dc:date" not in contents[0]


def test_other_endings_are_rejected(tmp_path):
    with pytest.raises(InvalidInput, match=r"\.png, \.pdf, \.svg, got .*a\.jpg"):
        save_figure(tmp_path / "a.jpg", blank_figure(2.0, 2.0))
    assert not list(tmp_path.iterdir())


def test_downsampling_keeps_small_clouds_and_bounds_large_ones():
    np.testing.assert_array_equal(downsampled_rows(5), np.arange(5))
    rows = downsampled_rows(1_000_001)
    assert 30_000 < len(rows) <= 60_000
    assert len(np.unique(np.diff(rows))) == 1
    assert rows[-1] < 1_000_001


@pytest.mark.parametrize("count", [0, 1, 10, 10_000])
def test_the_interleaved_order_spreads_every_part(count):
    order = interleaved_order(count)
    np.testing.assert_array_equal(np.sort(order), np.arange(count))
    if count > 100:
        halves = order[count // 2 :] < count // 2
        assert 0.45 < halves.mean() < 0.55


def test_a_window_contains_nearly_all_points_without_the_farthest():
    rng = np.random.default_rng(0)
    view = rng.uniform([90.0, 40.0], [110.0, 60.0], (5000, 2))
    view[:10] = 1e6
    centre, half = window_around(view[:2500], view[2500:])
    np.testing.assert_allclose(centre, [100.0, 50.0], atol=0.5)
    assert 9.0 < half < 12.0


@pytest.mark.parametrize("views", [[], [np.empty((0, 2))], [np.zeros((4, 2))]])
def test_a_window_without_points_has_a_minimum_size(views):
    centre, half = window_around(*views)
    assert centre.tolist() == [0.0, 0.0]
    assert half == 1.0


def _upright(rng, low, high, count):
    return rng.uniform([*low, 0.0], [*high, 3.0], (count, 3))


def test_the_close_up_has_objects_in_all_clouds():
    rng = np.random.default_rng(0)
    common = _upright(rng, (12.0, 12.0), (18.0, 18.0), 3000)
    level = rng.uniform([-30.0, -30.0, 0.0], [30.0, 30.0, 0.1], (30_000, 3))
    first = np.concatenate([common, level, _upright(rng, (-30.0, -30.0), (-10.0, -10.0), 9000)])
    second = np.concatenate([common, level, _upright(rng, (-30.0, 10.0), (-10.0, 30.0), 9000)])
    corner = close_up_corner([first, second], np.zeros(2), 30.0, 10.0)
    assert (corner <= 12.5).all()
    assert (corner + 10.0 >= 17.5).all()


def test_the_close_up_has_flat_surfaces_in_the_absence_of_objects():
    rng = np.random.default_rng(0)
    level = rng.uniform([12.0, 12.0, 0.0], [18.0, 18.0, 0.1], (2000, 3))
    corner = close_up_corner([level], np.zeros(2), 30.0, 10.0)
    assert (corner <= 12.5).all()
    assert (corner + 10.0 >= 17.5).all()


@pytest.mark.parametrize("cloud", [np.empty((0, 3)), np.full((3, 3), 99.0)])
def test_the_close_up_of_an_empty_map_is_inside_it(cloud):
    corner = close_up_corner([cloud], np.zeros(2), 1.0, 5.0)
    assert corner.tolist() == [-1.0, -1.0]


def test_views_are_square_maps_with_frames_and_a_legend():
    figure = blank_figure(4.0, 4.0)
    axes = figure.subplots()
    set_map_view(axes, np.array([5.0, 1.0]), 2.0, ("x [m]", "y [m]"))
    assert (axes.get_xlim(), axes.get_ylim()) == ((3.0, 7.0), (-1.0, 3.0))
    assert axes.get_aspect() == 1.0
    draw_frame(axes, np.array([4.0, 0.0]), 1.5)
    [rectangle] = axes.patches
    assert (rectangle.get_xy(), rectangle.get_width()) == ((4.0, 0.0), 1.5)
    legend_below(figure, {"one": "#000000", "other": "#ffffff"})
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["one", "other"]
