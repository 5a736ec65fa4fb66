"""One street and one forest for all tests, as `scan_pair` draws them from the same seed."""

import numba
import numpy as np
import pytest

from scanlock.simulation import forest, street

SEED = 3


def scene_rng():
    return np.random.default_rng(np.random.SeedSequence(SEED).spawn(4)[0])


@pytest.fixture(scope="session")
def _compiler():
    if numba.config.DISABLE_JIT:
        pytest.skip("whole scenes have too many rays for kernels that are not compiled")


@pytest.fixture(scope="session")
def street_scene(_compiler):
    return street(scene_rng())


@pytest.fixture(scope="session")
def forest_scene(_compiler):
    return forest(scene_rng())
