import numpy as np
import pytest
from matplotlib.colors import to_rgba_array

from reference.samples import street
from scanlock import segment
from scanlock.report.canvas import ALARM, CATEGORIES, FAINT, GROUND, INK, save_figure
from scanlock.report.segmentation_figure import segmentation_figure


@pytest.fixture(scope="module")
def found():
    points = street(1)
    points[::7] = np.nan
    return segment(points)


def _drawn(axes):
    [dots] = axes.collections
    return np.asarray(dots.get_offsets()), dots.get_facecolors()


def test_each_point_has_the_colour_of_its_label(found):
    positions, colours = _drawn(segmentation_figure(found).axes[0])
    labels = found.labels[found.cloud.rows]
    for mask, colour in ((labels == 0, GROUND), (labels == -1, FAINT)):
        mine = (colours == to_rgba_array(colour)).all(axis=1)
        np.testing.assert_array_equal(
            np.sort(positions[mine], axis=0), np.sort(found.cloud.points[mask, :2], axis=0)
        )
    for label in (1, 2, len(CATEGORIES) + 1):
        member = found.cloud.points[np.flatnonzero(labels == label)[0], :2]
        [row] = np.flatnonzero((positions == member).all(axis=1))
        expected = to_rgba_array(CATEGORIES[(label - 1) % len(CATEGORIES)])[0]
        np.testing.assert_array_equal(colours[row], expected)


def test_ground_is_drawn_below_the_rest(found):
    _, colours = _drawn(segmentation_figure(found).axes[0])
    is_ground = (colours == to_rgba_array(GROUND)).all(axis=1)
    assert is_ground[: is_ground.sum()].all()


def test_the_oblique_view_shows_the_framed_region_only(found):
    whole, close = segmentation_figure(found).axes
    [rectangle] = whole.patches
    low = np.array(rectangle.get_xy())
    plan = found.cloud.points[:, :2]
    inside = ((plan >= low) & (plan <= low + rectangle.get_width())).all(axis=1)
    assert 0 < len(_drawn(close)[0]) == inside.sum() < len(plan)


def test_the_title_has_the_counts(found):
    title = segmentation_figure(found)._suptitle
    ratio = 100.0 * (found.labels[found.cloud.rows] == 0).mean()
    assert title.get_text() == (
        f"ground ({ratio:.0f} % of the points) and {found.cluster_count} clusters"
    )
    assert title.get_color() == INK


@pytest.mark.slow
def test_a_scan_without_ground_gives_a_figure_with_a_red_title(tmp_path):
    ball = np.random.default_rng(0).normal(size=(2000, 3)) * 5.0
    figure = segmentation_figure(segment(ball))
    assert "no ground: " in figure._suptitle.get_text()
    assert figure._suptitle.get_color() == ALARM
    save_figure(tmp_path / "ball.pdf", figure)
    assert (tmp_path / "ball.pdf").stat().st_size > 10_000
