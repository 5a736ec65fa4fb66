import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference import sampling_pattern as reference
from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.uncertainty.sampling_pattern import (
    SamplingPattern,
    hessian_along_surfaces,
)

_TILTED = Pose(exp_rotation(np.array([0.1, -0.2, 0.7])), np.array([4.0, -9.0, 2.0]))


def _rings(spacing, step, count=24):
    """Points of a scanner with equally spaced beams and azimuths [deg], on a round wall."""
    elevations = np.radians(spacing) * (np.arange(count) - 0.4 * count)
    azimuths = np.arange(0.0, 2.0 * np.pi, np.radians(step))
    elevation, azimuth = (one.ravel() for one in np.meshgrid(elevations, azimuths))
    return 12.0 * np.column_stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)])


@given(spacing=st.floats(0.3, 3.0), step=st.floats(0.1, 0.4))
def test_the_gaps_of_rings_are_the_angles_between_beams_and_between_points(spacing, step):
    pattern = SamplingPattern.of_points(_rings(spacing, step))
    assert np.degrees(pattern.elevation_gap) == pytest.approx(spacing, rel=0.01)
    assert np.degrees(pattern.azimuth_gap) == pytest.approx(step, rel=0.01)


def test_the_gaps_are_angles_whatever_the_unit_of_length():
    points = street(3, 20000)
    one, other = (SamplingPattern.of_points(scale * points) for scale in (1.0, 0.25))
    assert other.elevation_gap == pytest.approx(one.elevation_gap, rel=1e-3)
    assert other.azimuth_gap == pytest.approx(one.azimuth_gap, rel=1e-3)


def test_without_alternate_blocks_the_gap_is_a_block():
    points = _rings(0.5, 0.2)
    azimuths = np.degrees(np.arctan2(points[:, 1], points[:, 0])) + 181.5
    pattern = SamplingPattern.of_points(points[azimuths // 3.0 % 2 == 0])
    assert np.degrees(pattern.azimuth_gap) == pytest.approx(3.2, abs=0.25)
    assert np.degrees(pattern.elevation_gap) == pytest.approx(0.5, rel=0.01)


@pytest.mark.parametrize("count", [1, 2])
def test_a_few_points_have_no_gaps(count):
    points = np.array([[3.0, 4.0, 1.0], [-5.0, 2.0, 0.3]])[:count]
    assert SamplingPattern.of_points(points) == SamplingPattern(elevation_gap=0.0, azimuth_gap=0.0)


def test_the_pattern_turns_about_the_sensor_of_the_source():
    gaps = np.array([0.02, 0.02, 0.005])
    pattern = SamplingPattern(elevation_gap=gaps[0], azimuth_gap=gaps[2])
    to_source = Pose(np.eye(3), -_TILTED.translation).adjoint()
    found = to_source @ pattern.covariance(_TILTED) @ to_source.T
    rotation = _TILTED.rotation @ np.diag(gaps**2 / 12.0) @ _TILTED.rotation.T
    np.testing.assert_allclose(found[3:, 3:], rotation, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(found[:3], 0.0, atol=1e-12)


def _cells(seed, count=40, per_cell=5):
    """Hessians of cells of point-to-point terms with random precisions, and their positions."""
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-20.0, 20.0, (count, 3))
    half = rng.normal(size=(count, 3, per_cell))
    precisions = half @ half.transpose(0, 2, 1)
    motions = np.array([reference.motion_of(position) for position in positions])
    return motions.transpose(0, 2, 1) @ precisions @ motions, positions


@pytest.mark.parametrize("seed", range(3))
def test_the_hessian_along_surfaces_is_that_of_the_definition(seed):
    hessians, positions = _cells(seed)
    found = hessian_along_surfaces(hessians, positions)
    expected = reference.hessian_along_surfaces(hessians, positions)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9)
    # The part along the normals is left out, and nothing else.
    assert np.linalg.eigvalsh(hessians.sum(axis=0) - found)[0] > 0.0


def test_planes_have_no_hessian_along_their_surfaces():
    hessians, positions = _cells(4, per_cell=1)
    scale = np.abs(hessians.sum(axis=0)).max()
    assert np.abs(hessian_along_surfaces(hessians, positions)).max() < 1e-6 * scale


def test_the_hessian_along_surfaces_turns_with_the_target():
    hessians, positions = _cells(5)
    motion = yaw_pose(0.8, (0.0, 0.0, 0.0))
    turn = motion.adjoint()
    turned = hessian_along_surfaces(turn @ hessians @ turn.T, motion.apply(positions))
    expected = turn @ hessian_along_surfaces(hessians, positions) @ turn.T
    np.testing.assert_allclose(turned, expected, rtol=1e-8, atol=1e-8)
