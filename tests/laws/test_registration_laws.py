"""Registrations of one synthetic street under random motions."""

from functools import cache

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from reference.samples import street
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

_METHODS = st.sampled_from(sorted(METHODS))
_BLURRED = st.sampled_from(["sgc-ndt-d2d", "sgc-ndt-p2d"])
"""Methods that blur the score, and so have a basin that is known beforehand."""


@cache
def _street(seed):
    return street(seed, 4000)


@st.composite
def _motions(draw, metres, radians):
    """A motion of at most so much along the ground and about z, a tenth of it otherwise."""
    unit = st.floats(-1.0, 1.0)
    shares = np.array(draw(st.tuples(unit, unit, unit, unit, unit, unit)))
    flat = metres / np.sqrt(2.0)
    return Pose.from_step(
        shares * [flat, flat, 0.1 * metres, 0.1 * radians, 0.1 * radians, radians]
    )


@given(method=_BLURRED, motion=_motions(4.0, 0.5))
@settings(max_examples=15)
def test_a_motion_within_the_basin_is_recovered_and_trusted(method, motion):
    # Half the basin that the widest blur promises. Bounds as in the contracts, doubled in
    # rotation: roll and pitch hang on the heights of parts alone.
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
def test_neither_order_nor_repetition_of_rows_matters(method, motion, seed):
    rng = np.random.default_rng(seed)
    source = motion.inverse().apply(_street(2))
    once = register(source=source, target=_street(1), method=method)
    again = register(
        source=rng.permutation(source), target=rng.permutation(_street(1)), method=method
    )
    gaps = once.target_from_source.apply(source) - again.target_from_source.apply(source)
    assert np.abs(gaps).max() < 1e-5
    assert once.status is again.status
