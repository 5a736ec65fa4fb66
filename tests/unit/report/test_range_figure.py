import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.report.range_figure import range_figure

IMAGE = np.arange(1.0, 13.0).reshape(3, 4)


def test_images_share_one_colour_scale():
    incomplete = np.where(IMAGE == 6.0, np.nan, IMAGE)
    upper, lower, _ = range_figure({"M": IMAGE, "D": incomplete}).axes
    for axes, image in ((upper, IMAGE), (lower, incomplete)):
        [shown] = axes.get_images()
        np.testing.assert_array_equal(shown.get_array().filled(np.nan), image)
        assert shown.get_clim() == upper.get_images()[0].get_clim()
    assert [axes.get_title() for axes in (upper, lower)] == ["M: 12 points", "D: 11 points"]


@pytest.mark.parametrize("images", [{}, {"M": np.full((2, 2), np.nan)}])
def test_images_without_ranges_are_rejected(images):
    with pytest.raises(InvalidInput, match="at least one range"):
        range_figure(images)
