import numpy as np
import pytest

from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.simulation import hdl_32e, simulate_scan
from scanlock.simulation.scenes.look_alikes import (
    corridor,
    crossing,
    open_field,
    shaft,
    terrace,
    tunnel,
)

_NOISE_FREE = {"range_noise": 0.0, "dropout": 0.0, "fading": 0.0}


def _scanned(world, pose):
    from dataclasses import replace

    # Without noise and lost returns, scans depend on the world only.
    sensor = replace(hdl_32e(), **_NOISE_FREE, azimuth_steps=360)
    return simulate_scan(world, sensor, pose, np.random.default_rng(0)).points


def _at(x=0.0, y=0.0, z=0.0, yaw=0.0):
    return Pose.from_step(np.array([x, y, z, 0.0, 0.0, 0.0])) @ Pose.from_step(
        np.array([0.0, 0.0, 0.0, 0.0, 0.0, yaw])
    )


@pytest.mark.parametrize(
    ("world", "one", "other"),
    [
        (open_field(), _at(z=1.5), _at(x=7.0, y=-3.0, z=1.5, yaw=0.4)),
        (corridor(), _at(z=1.2), _at(x=9.3, z=1.2)),
        (tunnel(), _at(y=0.3), _at(x=-5.5, y=0.3)),
        (shaft(sides=90), _at(z=1.2), _at(z=1.2, yaw=np.radians(4.0 * 11))),
        (crossing(), _at(z=1.2), _at(z=1.2, yaw=np.pi / 2)),
        (terrace(spacing=8.0), _at(z=1.2), _at(x=16.0, z=1.2)),
    ],
    ids=["field", "corridor", "tunnel", "shaft", "crossing", "terrace"],
)
def test_scans_from_ambiguous_poses_are_equal(world, one, other):
    first, second = (_scanned(world, pose) for pose in (one, other))
    # A ray along an edge may hit either side of it.
    assert abs(len(first) - len(second)) < 0.01 * len(first)
    ranges = [np.sort(np.linalg.norm(points, axis=1)) for points in (first, second)]
    shares = np.linspace(0.05, 0.95, 19)
    np.testing.assert_allclose(*(np.quantile(one, shares) for one in ranges), rtol=0.02)
    assert len(first) > 1000


@pytest.mark.parametrize(
    ("make", "name"), [(corridor, "width"), (tunnel, "radius"), (shaft, "radius"),
                       (crossing, "street"), (terrace, "spacing")],
)  # fmt: skip
def test_sizes_that_are_not_positive_are_refused(make, name):
    with pytest.raises(InvalidInput, match=name):
        make(**{name: 0.0})
