"""Settings of the whole suite: one compile cache, and the real scans."""

import gc
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

# The cache is keyed by the source of the kernels, so that all checkouts can share it. Set before
# anything imports numba.
os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(tempfile.gettempdir()) / "scanlock-kernels"))

settings.register_profile(
    "scanlock",
    deadline=None,  # the first call of a kernel compiles it
    max_examples=50,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("scanlock")

# Thousands of tests are collected and kept: searching them for garbage takes a tenth of the time.
gc.disable()


def pytest_collection_finish() -> None:
    """Collect the garbage of the tests alone."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def scan_data() -> Path:
    """The folder of real scans; tests that need it are skipped without it."""
    folder = os.environ.get("SCANLOCK_DATA")
    if not folder:
        pytest.skip("set SCANLOCK_DATA to the folder of real scans to run this test")
    path = Path(folder)
    if not path.is_dir():
        pytest.fail(f"SCANLOCK_DATA is {folder}, which is not a folder")
    return path
