import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.errors import InvalidInput
from scanlock.evaluation.sensor_axes import CAMERA_FROM_LASER, in_other_frame
from scanlock.evaluation.trajectory_errors import absolute_errors, relative_errors
from scanlock.report.trajectory_figure import trajectory_figure

TRUTH = [yaw_pose(0.02 * k, (2.0 * k, 0.01 * k * k, 0.1)) for k in range(40)]
ESTIMATE = [
    yaw_pose(1.0, (5.0, 5.0, 0.0)) @ yaw_pose(0.022 * k, (2.1 * k, 0.0, 0.1)) for k in range(40)
]


def _axes(figure):
    """The views by their title, or x label; the colour bar left out."""
    above, upper, lower, *others = [axes for axes in figure.axes if axes.get_label() == ""]
    return above, upper, lower, others


def _curve(axes):
    return axes.lines[0].get_xydata()


def test_both_trajectories_are_drawn_in_the_frame_of_the_true_one():
    above, *_ = _axes(trajectory_figure(ESTIMATE, TRUTH))
    true = np.array([pose.translation[:2] for pose in TRUTH])
    np.testing.assert_array_equal(_curve(above), true)
    [path] = above.collections
    np.testing.assert_allclose(path.get_segments()[0][0], true[0], atol=1e-9)
    above, *_ = _axes(trajectory_figure(ESTIMATE, TRUTH, alignment="none"))
    ends = [section[1] for section in above.collections[0].get_segments()]
    np.testing.assert_array_equal(ends, [pose.translation[:2] for pose in ESTIMATE[1:]])


def test_the_estimate_is_coloured_by_its_error():
    above, *_ = _axes(trajectory_figure(ESTIMATE, TRUTH))
    errors = absolute_errors(ESTIMATE, TRUTH, "first").translations
    np.testing.assert_array_equal(above.collections[0].get_array(), errors[1:])


def test_the_ground_is_drawn_for_a_camera_too():
    above, *_ = _axes(trajectory_figure(ESTIMATE, TRUTH))
    assert (above.get_xlabel(), above.get_ylabel()) == ("x [m]", "y [m]")
    cameras = (in_other_frame(poses, CAMERA_FROM_LASER) for poses in (ESTIMATE, TRUTH))
    above, *_ = _axes(trajectory_figure(*cameras))
    assert (above.get_xlabel(), above.get_ylabel()) == ("x [m]", "z [m]")


@pytest.mark.parametrize("alignment", ["none", "first", "all", "all+scale"])
def test_errors_are_drawn_along_the_true_path(alignment):
    _, upper, lower, others = _axes(trajectory_figure(ESTIMATE, TRUTH, alignment=alignment))
    assert others == []
    errors = absolute_errors(ESTIMATE, TRUTH, alignment)
    np.testing.assert_allclose(_curve(upper)[:, 1], errors.translations)
    np.testing.assert_allclose(_curve(lower)[:, 1], np.degrees(errors.rotations))
    steps = np.diff(_curve(upper)[:, 0])
    np.testing.assert_allclose(steps, np.hypot(2.0, 0.01 * (2 * np.arange(39) + 1)))


def test_relative_errors_are_drawn_at_the_ends_of_the_motions_over_time():
    times = 100.0 + 0.5 * np.arange(40)
    relative = relative_errors(ESTIMATE, TRUTH, 3)
    figure = trajectory_figure(ESTIMATE, TRUTH, relative=relative, apart="3 scans", times=times)
    _, upper, _, (translation, rotation) = _axes(figure)
    np.testing.assert_allclose(_curve(upper)[:, 0], 0.5 * np.arange(40))
    assert translation.get_title() == "relative error over 3 scans (RPE)"
    np.testing.assert_allclose(_curve(translation)[:, 0], 0.5 * relative.last)
    np.testing.assert_allclose(_curve(rotation)[:, 1], np.degrees(relative.rotations))


def test_the_title_is_optional():
    assert trajectory_figure(TRUTH, TRUTH, title="a drive")._suptitle.get_text() == "a drive"
    assert trajectory_figure(TRUTH, TRUTH)._suptitle is None


@pytest.mark.slow
def test_one_pose_gives_a_figure_and_none_is_rejected(tmp_path):
    figure = trajectory_figure(TRUTH[:1], ESTIMATE[:1])
    figure.savefig(tmp_path / "one.png")
    with pytest.raises(InvalidInput, match="at least one, got 0 and 0"):
        trajectory_figure([], [])
