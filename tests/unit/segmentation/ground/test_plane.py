import numpy as np
import pytest

from scanlock.segmentation.ground.plane import fit_base_plane


def test_the_best_sampled_plane_has_the_most_inliers():
    rng = np.random.default_rng(2)
    floor = np.column_stack([rng.uniform(-20, 20, (300, 2)), rng.normal(-1.5, 0.02, 300)])
    clutter = np.column_stack([rng.uniform(-20, 20, (600, 2)), rng.uniform(-1.5, 6, 600)])
    plane = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert plane.tilt < 0.01
    assert plane.offset == pytest.approx(1.5, abs=0.03)
    # The result is bitwise reproducible.
    again = fit_base_plane(np.vstack([floor, clutter]), max_tilt=0.7)
    assert (plane.coefficients == again.coefficients).all()


def test_points_on_a_line_have_no_plane():
    line = np.column_stack([np.linspace(1, 9, 40), np.zeros(40), np.zeros(40)])
    for low in (np.zeros((0, 3)), np.ones((2, 3)), np.ones((30, 3)), line):
        assert fit_base_plane(low, max_tilt=0.7) is None
