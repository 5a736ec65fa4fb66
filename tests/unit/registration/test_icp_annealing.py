"""ICP from beyond its basin, with simulated annealing in front and without."""

import math

import numpy as np
import pytest

from reference.pairs import register_pair
from reference.samples import street
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED
from scanlock.optimisation.solvers.annealing import Annealing
from scanlock.registration.methods.icp import Icp
from scanlock.registration.methods.icp_annealing import AnnealedStart
from scanlock.registration.register import register

_PLAIN = Icp()
_ANNEALED = Icp(annealing=AnnealedStart())

# Ten degrees about the vertical and three metres along each axis: data set #4 of the paper.
_FOURTH = Pose.from_step(np.array([3.0, 3.0, 3.0, 0.0, 0.0, math.radians(10.0)]))
_FAR = Pose.from_step(np.array([5.0, 2.5, 1.0, 0.0, 0.0, math.radians(20.0)]))


def _pair(layout, motion=_FAR):
    return motion.inverse().apply(street(2, layout=layout)), street(1, layout=layout)


@pytest.mark.parametrize("motion", [_FOURTH, _FAR], ids=["paper", "farther"])
@pytest.mark.parametrize("layout", [0, 1, 2])
def test_annealing_finds_far_motions(layout, motion):
    found = register_pair(_pair(layout, motion), method=_ANNEALED)
    assert found.target_from_source.is_close(motion, translation=0.1, rotation=0.005)
    assert any(note.startswith("annealing found") for note in found.notes)


@pytest.mark.parametrize("layout", [0, 1, 2])
def test_plain_icp_ends_in_a_wrong_minimum_there(layout):
    found = register_pair(_pair(layout), method=_PLAIN)
    assert found.target_from_source.distance(_FAR)[0] > 1.0
    assert not found.ok


def test_a_good_start_is_not_lost_to_the_search():
    found = register(source=street(2), target=street(1), method=_ANNEALED).target_from_source
    assert found == register(source=street(2), target=street(1), method=_PLAIN).target_from_source


def test_the_least_distance_wins_where_any_advantage_counts():
    eager = Icp(annealing=AnnealedStart(min_improvement=0.0))
    looks = (street(1, layout=2), street(2, layout=2))
    scans = [eager.prepare(PointCloud.from_array(points)) for points in looks]
    starts = eager.annealing.poses(*scans, Pose.identity(), UNCONSTRAINED)
    ends = [_PLAIN.align(*scans, start).pose for start in starts]
    gaps = [eager.annealing.trimmed_distance(*scans, end) for end in ends]
    assert eager.align(*scans, Pose.identity()).pose == ends[int(np.argmin(gaps))]
    # Chance leads to fixed points that are better than that of the start by next to nothing.
    assert 0.99 * gaps[0] < min(gaps) < gaps[0]
    assert _ANNEALED.align(*scans, Pose.identity()).pose == ends[0]


def test_the_seed_decides_and_nothing_else():
    source, target = _pair(3)
    once, again = (register(source=source, target=target, method=_ANNEALED) for _ in range(2))
    assert once.target_from_source == again.target_from_source
    other = Icp(annealing=AnnealedStart(seed=9, annealing=Annealing(seed=9)))
    found = register(source=source, target=target, method=other).target_from_source
    assert found.is_close(once.target_from_source, translation=0.02, rotation=0.001)


def test_settings_out_of_range_are_refused():
    with pytest.raises(InvalidInput, match="trim"):
        AnnealedStart(inlier_ratio=0.0)
    with pytest.raises(InvalidInput, match="advantage"):
        AnnealedStart(min_improvement=1.5)
    with pytest.raises(InvalidInput, match="sample"):
        AnnealedStart(sample_size=0)
