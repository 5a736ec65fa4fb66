import numpy as np
import pytest

from reference.samples import street
from scanlock.errors import InvalidInput
from scanlock.report.alignment_figure import Alignment, alignment_figure

POINTS = street(1, 3000)


def _sources(*names):
    return {name: POINTS + shift for shift, name in enumerate(names)}


def test_a_row_shows_one_square_at_all_poses():
    rows = [Alignment(title, POINTS, _sources("before", "after")) for title in ("#1", "#2")]
    axes = np.array(alignment_figure(rows).axes).reshape(2, 2)
    titles = [one.get_title() for one in axes.ravel()]
    assert titles == ["#1\nbefore", "#1\nafter", "#2\nbefore", "#2\nafter"]
    for left, right in axes:
        assert (left.get_xlim(), left.get_ylim()) == (right.get_xlim(), right.get_ylim())
        assert np.ptp(left.get_xlim()) == pytest.approx(16.0)
    [dots] = axes[0, 1].collections
    positions = {tuple(position) for position in np.round(np.asarray(dots.get_offsets()), 6)}
    expected = np.concatenate([POINTS, POINTS + 1.0])[:, :2]
    assert positions == {tuple(position) for position in np.round(expected, 6)}


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [Alignment("x", POINTS, {})],
        [Alignment("x", POINTS, _sources("a")), Alignment("y", POINTS, _sources("a", "b"))],
    ],
)
def test_rows_of_different_length_are_rejected(rows):
    with pytest.raises(InvalidInput, match="the same number of poses"):
        alignment_figure(rows)
