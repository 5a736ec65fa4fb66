import numpy as np

from scanlock.simulation.scenes.site import Site, car_pose, upright_pose
from scanlock.simulation.waves import Waves, smoothstep


def test_a_claim_succeeds_once_and_only_on_free_ground():
    site = Site(np.array([-20.0, -20.0]), np.array([20.0, 20.0]))
    assert site.claim(np.array([0.0, 0.0]), 0.7, 8.0, 4.0)
    assert not site.claim(np.array([0.0, 0.0]), 0.0, 1.0, 1.0)
    assert not site.claim(np.array([3.0 * np.cos(0.7), 3.0 * np.sin(0.7)]), 0.0, 0.5, 0.5)
    # There is room beside its narrow side, but not with a margin.
    aside = 4.0 * np.array([-np.sin(0.7), np.cos(0.7)])
    assert not site.claim(aside, 0.7, 2.0, 2.0, margin=2.0)
    assert site.claim(aside, 0.7, 2.0, 2.0)
    assert not site.claim(np.array([19.9, 0.0]), 0.0, 2.0, 2.0)


def test_blocked_cells_are_occupied():
    site = Site(np.zeros(2), np.array([10.0, 10.0]))
    site.block(site.cells()[:, 0] < 5.0)
    assert not site.claim(np.array([3.0, 5.0]), 0.0, 1.0, 1.0)
    assert site.claim(np.array([8.0, 5.0]), 0.0, 1.0, 1.0)


def test_objects_are_upright_and_cars_have_both_axles_on_the_ground():
    pose = upright_pose(np.array([1.0, 2.0, 3.0]), np.pi / 2)
    np.testing.assert_allclose(pose.apply(np.array([1.0, 0, 1])), [1, 3, 4], atol=1e-12)
    car = car_pose(lambda xy: 0.1 * xy[:, 1], np.array([5.0, 6.0]), np.pi / 2)
    axles = car.apply(np.array([[1.3, 0.0, 0], [-1.3, 0, 0]]))
    np.testing.assert_allclose(axles[:, 2], 0.1 * axles[:, 1], atol=1e-12)


def test_waves_have_the_given_deviation_and_minimum_length():
    waves = Waves.drawn(np.random.default_rng(3), 0.5, 10.0, 40.0)
    x = np.random.default_rng(4).uniform(-5000, 5000, (20000, 2))
    values = waves.at(x)
    assert abs(values.mean()) < 0.05
    assert 0.45 < values.std() < 0.55
    slope = (waves.at(x + np.array([0.01, 0.0])) - values) / 0.01
    assert np.abs(slope).max() < 2 * np.pi / 10.0 * np.abs(waves.heights).sum()


def test_smoothstep_rises_from_0_to_1():
    x = np.linspace(-1, 4, 101)
    y = smoothstep(x, 0.0, 2.0)
    assert (y[x <= 0] == 0).all()
    assert (y[x >= 2] == 1).all()
    assert (np.diff(y) >= 0).all()
    assert smoothstep(np.array([1.0]), 0.0, 2.0)[0] == 0.5
