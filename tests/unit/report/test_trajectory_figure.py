import numpy as np
import pytest
from matplotlib.colors import to_hex

from reference.samples import yaw_pose
from scanlock.errors import InvalidInput
from scanlock.evaluation.trajectory_errors import absolute_errors
from scanlock.report.canvas import BLUE, VERMILION
from scanlock.report.trajectory_figure import trajectory_figure

TRUTH = [yaw_pose(0.02 * k, (2.0 * k, 0.01 * k * k, 0.1)) for k in range(40)]
ESTIMATE = [
    yaw_pose(1.0, (5.0, 5.0, 0.0)) @ yaw_pose(0.022 * k, (2.1 * k, 0.0, 0.1)) for k in range(40)
]


def _line(axes, colour):
    [found] = [
        line.get_xydata()
        for line in axes.lines
        if to_hex(line.get_color()) == colour and len(line.get_xydata()) > 1
    ]
    return found


def test_both_trajectories_are_drawn_in_the_frame_of_the_true_one():
    above = trajectory_figure(ESTIMATE, TRUTH).axes[0]
    true = np.array([pose.translation[:2] for pose in TRUTH])
    np.testing.assert_array_equal(_line(above, BLUE), true)
    np.testing.assert_allclose(_line(above, VERMILION)[0], true[0], atol=1e-9)
    moved = _line(trajectory_figure(ESTIMATE, TRUTH, alignment="none").axes[0], VERMILION)
    np.testing.assert_array_equal(moved, [pose.translation[:2] for pose in ESTIMATE])


@pytest.mark.parametrize("alignment", ["none", "first", "all"])
def test_errors_are_drawn_along_the_true_path(alignment):
    _, translation, rotation = trajectory_figure(ESTIMATE, TRUTH, alignment=alignment).axes
    errors = absolute_errors(ESTIMATE, TRUTH, alignment)
    np.testing.assert_allclose(_line(translation, VERMILION)[:, 1], errors.translations)
    np.testing.assert_allclose(_line(rotation, VERMILION)[:, 1], np.degrees(errors.rotations))
    steps = np.diff(_line(translation, VERMILION)[:, 0])
    np.testing.assert_allclose(steps, np.hypot(2.0, 0.01 * (2 * np.arange(39) + 1)))


def test_the_title_is_optional():
    assert trajectory_figure(TRUTH, TRUTH, title="a drive")._suptitle.get_text() == "a drive"
    assert trajectory_figure(TRUTH, TRUTH)._suptitle is None


@pytest.mark.slow
def test_one_pose_gives_a_figure_and_none_is_rejected(tmp_path):
    figure = trajectory_figure(TRUTH[:1], ESTIMATE[:1])
    figure.savefig(tmp_path / "one.png")
    with pytest.raises(InvalidInput, match="at least one, got 0 and 0"):
        trajectory_figure([], [])
