import numpy as np

from scanlock.simulation.terrain.waves import Waves, smoothstep


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
