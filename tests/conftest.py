"""Settings of the whole suite: a compile cache keyed by the kernels, and the real scans."""

import hashlib
import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

_ROOT = Path(__file__).resolve().parent.parent


def _kernel_digest() -> str:
    digest = hashlib.sha256()
    for path in sorted((_ROOT / "src" / "scanlock" / "kernels").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


# Numba does not notice that a kernel called from another file has changed, so every state of
# the kernels gets a cache of its own. Set before anything imports numba.
os.environ.setdefault(
    "NUMBA_CACHE_DIR", str(Path(tempfile.gettempdir()) / f"scanlock-kernels-{_kernel_digest()}")
)

settings.register_profile(
    "scanlock",
    deadline=None,  # the first call of a kernel compiles it
    max_examples=50,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("scanlock")


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
