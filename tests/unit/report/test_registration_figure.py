import math
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.colors import to_rgba_array

from reference.samples import street, yaw_pose
from scanlock import LocalOrigins, PointCloud, Pose, RegistrationResult, Status, segment
from scanlock.registration.verification.metrics import Metrics
from scanlock.report.canvas import ALARM, BLUE, INK, VERMILION, save_figure
from scanlock.report.registration_figure import registration_figure

MOTION = yaw_pose(0.2, (2.0, 1.0, 0.0))


def _result(pose=MOTION, status=Status.OK, overlap=0.8):
    metrics = Metrics(overlap=overlap, score=0.7)
    timings = {"total": 0.1}
    return RegistrationResult(
        target_from_source=pose,
        status=status,
        reason="a reason",
        method="a-method",
        metrics=metrics,
        probability=0.9,
        timings=timings,
    )


@pytest.fixture(scope="module")
def scans():
    return {"target": street(1), "source": MOTION.inverse().apply(street(2))}


def _points_in(axes, colour):
    [dots] = axes.collections
    mine = (dots.get_facecolors() == to_rgba_array(colour)).all(axis=1)
    return np.sort(np.asarray(dots.get_offsets())[mine], axis=0)


def _obstacles(points, pose=None):
    obstacles = points[~segment(points).is_ground]
    return np.sort((pose or Pose.identity()).apply(obstacles)[:, :2], axis=0)


@pytest.mark.parametrize("row", [0, 1])
def test_the_source_is_drawn_before_and_after_over_the_target(scans, row):
    figure = registration_figure(_result(), **scans)
    before, after = figure.axes[2 * row : 2 * row + 2]
    for axes, pose in ((before, Pose.identity()), (after, MOTION)):
        np.testing.assert_array_equal(_points_in(axes, BLUE), _obstacles(scans["target"]))
        np.testing.assert_allclose(_points_in(axes, VERMILION), _obstacles(scans["source"], pose))
    assert before.get_xlim() == after.get_xlim()


def test_the_view_before_shows_the_initial_pose(scans):
    start = yaw_pose(-0.3, (0.0, 4.0, 0.0))
    figure = registration_figure(_result(), **scans, initial=start)
    np.testing.assert_allclose(
        _points_in(figure.axes[0], VERMILION), _obstacles(scans["source"], start)
    )


def test_the_close_up_shows_the_framed_region(scans):
    figure = registration_figure(_result(), **scans)
    [rectangle] = figure.axes[1].patches
    x, y = rectangle.get_xy()
    close = figure.axes[3]
    assert close.get_xlim() == pytest.approx((x, x + rectangle.get_width()))
    assert close.get_ylim() == pytest.approx((y, y + rectangle.get_height()))
    inside = _points_in(close, BLUE)
    assert ((inside > [x, y]) & (inside < [x + 20, y + 20])).any()


@pytest.mark.parametrize(
    ("result", "truth", "parts", "colour"),
    [
        (_result(), None, ["a-method: ok", "turned 11.46°", "overlap 80 %"], INK),
        (_result(), MOTION, ["off by 0.0 cm and 0.000°"], INK),
        (_result(status=Status.LOW_OVERLAP), None, ["a-method: low overlap"], ALARM),
    ],
)
def test_the_title_has_the_status_and_the_error(scans, result, truth, parts, colour):
    title = registration_figure(result, **scans, truth=truth)._suptitle
    assert all(part in title.get_text() for part in parts)
    assert title.get_color() == colour


@pytest.mark.slow
def test_a_failed_registration_gives_a_figure(tmp_path):
    flat = np.random.default_rng(0).uniform(-20.0, 20.0, (2000, 3)) * [1.0, 1.0, 0.0]
    result = _result(Pose.identity(), Status.NO_CORRESPONDENCES, math.nan)
    figure = registration_figure(result, source=flat, target=flat)
    assert "overlap" not in figure._suptitle.get_text()
    save_figure(tmp_path / "pair.png", figure)
    assert (tmp_path / "pair.png").stat().st_size > 10_000


def test_map_coordinates_are_drawn_around_a_local_origin(scans):
    far = np.array([4e5, 5e6, 0.0])
    shift = Pose(np.eye(3), far)
    pose = shift @ MOTION @ shift.inverse()
    result = replace(_result(pose), origins=LocalOrigins.of_clouds(
        *(PointCloud.from_array(scans[name] + far) for name in ("target", "source"))
    ))  # fmt: skip
    moved = {name: points + far for name, points in scans.items()}
    figure = registration_figure(result, **moved)
    assert "moved 2." in figure._suptitle.get_text()
    assert np.abs(figure.axes[1].get_xlim()).max() < 100.0
    near = registration_figure(_result(), **scans)
    assert np.diff(figure.axes[1].get_xlim()) == pytest.approx(
        np.diff(near.axes[1].get_xlim()), rel=1e-3
    )
