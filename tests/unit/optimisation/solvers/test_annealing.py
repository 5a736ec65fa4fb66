import math

import numpy as np
import pytest

from reference.samples import yaw_pose
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.annealing import Annealing

_LOW = yaw_pose(0.3, (5.0, -3.0, 1.0))
_HIGH = yaw_pose(-0.2, (-3.0, 2.0, 0.0))


def _two_wells(pose):
    """A shallow well near the identity, and a deep one behind a ridge."""
    depths = ((_LOW, 2.0), (_HIGH, 1.0))
    return -max(
        depth * math.exp(-0.5 * (pose.scaled_distance(well, 10.0) / 3.0) ** 2)
        for well, depth in depths
    )


def test_the_deepest_of_two_wells_comes_first():
    found = Annealing().search(_two_wells, Pose.identity())
    assert found[0].pose.is_close(_LOW, translation=0.8, rotation=0.1)
    energies = [one.energy for one in found]
    assert energies == sorted(energies)
    assert energies[0] < _two_wells(Pose.identity())
    for one in found:
        assert one.energy == _two_wells(one.pose)


def test_minima_keep_the_minimum_separation():
    settings = Annealing(minima=4, min_separation=2.0)
    poses = [one.pose for one in settings.search(_two_wells, Pose.identity())]
    assert 1 < len(poses) <= 4
    for index, pose in enumerate(poses):
        for other in poses[:index]:
            assert pose.scaled_distance(other, 20.0) >= 2.0


@pytest.mark.slow
def test_the_same_seed_gives_bitwise_equal_minima_and_another_seed_does_not():
    once, again = (Annealing(seed=4).search(_two_wells, Pose.identity()) for _ in range(2))
    assert [(one.pose, one.energy) for one in once] == [(one.pose, one.energy) for one in again]
    other = Annealing(seed=5).search(_two_wells, Pose.identity())
    assert other[0].pose != once[0].pose


def test_locked_directions_are_never_proposed():
    free = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    for one in Annealing().search(_two_wells, Pose.identity(), free):
        assert one.pose.translation[2] == 0.0
        np.testing.assert_allclose(one.pose.rotation[2], [0.0, 0.0, 1.0], atol=1e-12)


def test_a_flat_energy_still_returns_poses():
    found = Annealing(steps=20).search(lambda pose: 1.0, Pose.identity())
    assert found[0].energy == 1.0


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cooling": 1.0}, "cooling must lie between 0 and 1, got 1"),
        ({"horizontal": 0.0}, r"horizontal must be positive, got 0\.0 m"),
        ({"yaw": -1.0}, "yaw must be positive"),
        ({"steps": 0}, "steps"),
    ],
)
def test_settings_out_of_range_are_rejected(settings, message):
    with pytest.raises(InvalidInput, match=message):
        Annealing(**settings)
