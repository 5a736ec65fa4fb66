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
def test_what_numba_makes_of_an_interrupt_is_one(depth):
    with pytest.raises(KeyboardInterrupt, match="pressed"), plain_interrupts():
        _return_and_raise(depth=depth)


def test_other_faults_of_the_system_are_no_interrupts():
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
def test_the_front_doors_raise_interrupts_as_such(monkeypatch, call):
    monkeypatch.setattr("scanlock.clouds.point_cloud.PointCloud.from_array", _return_and_raise)
    with pytest.raises(KeyboardInterrupt, match="pressed"):
        call()


def test_the_front_doors_keep_their_signatures():
    assert list(inspect.signature(scanlock.register).parameters)[:3] == [
        "source", "target", "method",
    ]  # fmt: skip
    assert scanlock.segment(_POINTS, Segmenter()).labels.shape == (50,)
