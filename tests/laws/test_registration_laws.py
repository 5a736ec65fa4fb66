"""Registrations of one synthetic street under random motions."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.samples import street
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

pytestmark = pytest.mark.slow

_METHODS = st.sampled_from(sorted(METHODS))
_SMOOTHED = st.sampled_from(["sgc-ndt-d2d", "sgc-ndt-p2d"])
"""Methods that smooth the score, which defines their basin of convergence."""


@cache
def _street(seed):
    return street(seed, 4000)


@st.composite
def _motions(draw, metres, radians):
    """A motion up to the given limits horizontally and about z, a tenth of them otherwise."""
    unit = st.floats(-1.0, 1.0)
    factors = np.array(draw(st.tuples(unit, unit, unit, unit, unit, unit)))
    flat = metres / np.sqrt(2.0)
    return Pose.from_step(
        factors * [flat, flat, 0.1 * metres, 0.1 * radians, 0.1 * radians, radians]
    )


@given(method=_SMOOTHED, motion=_motions(4.0, 0.5))
@settings(max_examples=15)
def test_a_motion_within_the_basin_is_recovered_and_trusted(method, motion):
    # Half the basin of the largest smoothing. Tolerances of the contract tests, doubled in
    # rotation: only the heights of clusters constrain roll and pitch.
    result = register(source=motion.inverse().apply(_street(2)), target=_street(1), method=method)
    assert result.status is Status.OK
    assert result.target_from_source.is_close(motion, translation=0.2, rotation=0.02)


@given(method=_METHODS, motion=_motions(15.0, 3.1))
@settings(max_examples=15)
def test_a_wrong_pose_is_never_trusted(method, motion):
    result = register(source=motion.inverse().apply(_street(2)), target=_street(1), method=method)
    assert np.isfinite(result.target_from_source.matrix).all()
    right = result.target_from_source.is_close(motion, translation=0.5, rotation=0.03)
    assert right or not result.ok


@given(method=_METHODS, motion=_motions(3.0, 0.3), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_the_order_of_the_points_does_not_matter(method, motion, seed):
    rng = np.random.default_rng(seed)
    source = motion.inverse().apply(_street(2))
    once = register(source=source, target=_street(1), method=method)
    again = register(
        source=rng.permutation(source), target=rng.permutation(_street(1)), method=method
    )
    differences = once.target_from_source.apply(source) - again.target_from_source.apply(source)
    assert np.abs(differences).max() < 1e-5
    assert once.status is again.status
