import numba
import numpy as np
import pytest

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


@pytest.mark.slow
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
