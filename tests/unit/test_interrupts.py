import inspect

import numpy as np
import pytest

import scanlock
from scanlock.interrupts import plain_interrupts
from scanlock.segmentation.segmentation import Segmenter

_POINTS = np.random.default_rng(0).uniform(-5.0, 5.0, (50, 3))


def _return_and_raise(*_, depth=1, **__):
    error = KeyboardInterrupt("pressed")
    for _ in range(depth):
        broken = SystemError("returned a result with an exception set")
        broken.__cause__ = error
        error = broken
    raise error


@pytest.mark.parametrize("depth", [1, 2])
def test_a_system_error_caused_by_an_interrupt_becomes_the_interrupt(depth):
    with pytest.raises(KeyboardInterrupt, match="pressed"), plain_interrupts():
        _return_and_raise(depth=depth)


def test_other_system_errors_are_raised_unchanged():
    with pytest.raises(SystemError, match="fault"), plain_interrupts():
        raise SystemError("fault") from ValueError("bad")


@pytest.mark.parametrize(
    "call",
    [
        lambda: scanlock.register(source=_POINTS, target=_POINTS),
        lambda: scanlock.prepare(_POINTS),
        lambda: scanlock.segment(_POINTS),
    ],
    ids=["register", "prepare", "segment"],
)
def test_public_functions_raise_interrupts_unchanged(monkeypatch, call):
    monkeypatch.setattr("scanlock.clouds.point_cloud.PointCloud.from_array", _return_and_raise)
    with pytest.raises(KeyboardInterrupt, match="pressed"):
        call()


def test_public_functions_keep_their_signatures():
    assert list(inspect.signature(scanlock.register).parameters)[:3] == [
        "source", "target", "method",
    ]  # fmt: skip
    assert scanlock.segment(_POINTS, Segmenter()).labels.shape == (50,)
