import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from scanlock.kernels import _cache
from scanlock.kernels._compile import NOTICE, kernel, sum_kernel


@kernel
def _ratio(a, b):
    return a / b


@sum_kernel
def _finite_sum(values):
    total = 0.0
    skipped = 0
    for value in values:
        if np.isnan(value) or np.isinf(value):
            skipped += 1
        else:
            total += value
    return total, skipped


def test_kernels_are_compiled_at_the_first_call():
    @kernel
    def twice(a):
        return 2 * a

    assert twice.signatures == []
    assert twice(2.5) == 5.0
    assert len(twice.signatures) == 1


def test_kernels_divide_like_numpy():
    assert _ratio(1.0, 0.0) == np.inf


def test_reordered_sums_detect_nan_and_infinity():
    values = np.array([1.0, np.nan, 2.0, np.inf, -np.inf, 4.0])
    assert _finite_sum(values) == (7.0, 3)


def test_reordered_sums_are_bitwise_reproducible():
    values = np.random.default_rng(0).normal(size=10_001)
    assert len({_finite_sum(values)[0] for _ in range(20)}) == 1


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
@pytest.mark.parametrize(
    ("locators", "end"), [("", "keeping them on disk"), ("ZipCacheLocator", "to one that is")]
)
def test_compiling_is_logged_once(monkeypatch, caplog, tmp_path, locators, end):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(numba.config, "CACHE_LOCATOR_CLASSES", locators)
    monkeypatch.setattr(NOTICE, "is_given", False)
    with caplog.at_level("INFO", "scanlock"):
        numba.njit(lambda a: a)(2)
        assert caplog.messages == []
        for _ in range(2):

            @kernel
            def twice(a):
                return 2 * a

            assert twice(2) == 4
            assert twice(2.0) == 4.0
    [record] = caplog.records
    assert record.levelname == "INFO"
    assert record.message.startswith("compiling kernels for the first use")
    assert record.message.endswith(end)


def test_a_kernel_works_without_a_writable_cache():
    # This locator caches archives only, so Numba finds no folder for its cache.
    code = (
        "import numpy as np\n"
        "from scanlock.kernels.points.polar import polar_cells\n"
        "print(polar_cells(np.array([[1.0, 0.1, 0.0]]), 4, np.array([0.0, 2.0])))\n"
    )
    environment = os.environ | {"NUMBA_CACHE_LOCATOR_CLASSES": "ZipCacheLocator"}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("[0]\n", "")


def test_the_digest_covers_the_file_of_a_kernel_and_the_shared_files(tmp_path, monkeypatch):
    monkeypatch.setattr(_cache, "__file__", str(tmp_path / "_cache.py"))
    own, shared = tmp_path / "polar.py", tmp_path / "_inline.py"
    digests = set()
    for own_text, shared_text in (("a", "b"), ("c", "b"), ("c", "d")):
        own.write_text(own_text)
        shared.write_text(shared_text)
        digests.add(_cache.digest_of.__wrapped__(str(own)))
    assert len(digests) == 3


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="needs a compiler")
def test_copies_of_a_kernel_in_two_folders_share_the_cache(monkeypatch, tmp_path):
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    code = "from scanlock.kernels._compile import kernel\n@kernel\ndef f(a):\n    return 3 * a\n"
    stats = []
    for folder in ("one", "two"):
        path = tmp_path / folder / "kernels" / "triple.py"
        path.parent.mkdir(parents=True)
        path.write_text(code)
        scope = {"__name__": "triple"}
        exec(compile(code, str(path), "exec"), scope)
        assert scope["f"](2) == 6
        stats.append(scope["f"].stats)
    assert [bool(one.cache_hits) for one in stats] == [False, True]
    assert stats[0].cache_path == stats[1].cache_path
