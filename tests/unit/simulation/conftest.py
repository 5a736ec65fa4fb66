"""One street and one forest for all tests, as `scan_pair` draws them from the same seed."""

import numpy as np
import pytest

from scanlock.simulation import forest, street

SEED = 3


def scene_rng():
    return np.random.default_rng(np.random.SeedSequence(SEED).spawn(4)[0])


@pytest.fixture(scope="session")
def street_scene():
    return street(scene_rng())


@pytest.fixture(scope="session")
def forest_scene():
    return forest(scene_rng())
