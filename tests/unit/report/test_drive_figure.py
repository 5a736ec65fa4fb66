import numpy as np
import pytest
from matplotlib.colors import to_hex

from scanlock.errors import InvalidInput
from scanlock.report.canvas import ALARM, INK
from scanlock.report.drive_figure import drive_figure

RNG = np.random.default_rng(0)
GROUND = np.column_stack([RNG.uniform(-30.0, 30.0, (20_000, 2)), np.zeros(20_000)])
PATH = np.column_stack([np.linspace(-25.0, 25.0, 11), np.zeros((11, 2))])


def _pixel(axes, x, y):
    image = axes.images[0]
    values = np.asarray(image.get_array().filled(np.nan))
    left, right, low, high = image.get_extent()
    column = int((x - left) / (right - left) * values.shape[1])
    row = int((y - low) / (high - low) * values.shape[0])
    return values[row, column]


def test_a_pixel_shows_its_highest_point():
    tree = np.array([[10.0, 20.0, 3.0], [10.0, 20.0, 7.5], [10.0, 20.0, 0.2]])
    axes = drive_figure(np.vstack([GROUND, tree]), PATH).axes[0]
    assert _pixel(axes, 10.0, 20.0) == 7.5
    values = axes.images[0].get_array().compressed()
    assert (values == 0.0).sum() > 15_000
    assert axes.images[0].get_clim()[1] < 7.5  # a single tree does not stretch the colours


def test_the_window_omits_far_points_and_includes_the_whole_path():
    far = np.array([[500.0, 0.0, 1.0], [-4000.0, 90.0, 1.0]])
    longer = np.vstack([PATH, [60.0, 0.0, 0.0]])
    axes = drive_figure(np.vstack([GROUND, far]), longer).axes[0]
    left, right = axes.get_xlim()
    assert left < -25.0
    assert 60.0 < right < 100.0


def test_untrusted_motions_and_the_title_are_drawn_in_red():
    axes = drive_figure(GROUND, PATH, unverified=[3, 8], title="two not trusted").axes[0]
    red = [line.get_xydata() for line in axes.lines if to_hex(line.get_color()) == ALARM]
    np.testing.assert_array_equal(red, [PATH[2:4, :2], PATH[7:9, :2]])
    assert axes.title.get_color() == ALARM
    plain = drive_figure(GROUND, PATH, title="fine").axes[0]
    assert plain.title.get_color() == INK
    assert all(to_hex(line.get_color()) != ALARM for line in plain.lines)


@pytest.mark.slow
def test_one_scan_gives_a_figure_and_none_is_rejected(tmp_path):
    drive_figure(GROUND[:1], PATH[:1]).savefig(tmp_path / "one.png")
    with pytest.raises(InvalidInput, match="got 0 points and a path of 11 positions"):
        drive_figure(GROUND[:0], PATH)
