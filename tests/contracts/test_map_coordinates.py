"""Map coordinates and initial poses, for every method."""

import json

import numpy as np
import pytest

from contracts.traits import METRES, RADIANS, TRAITS, motion, source, target
from reference.pairs import register_pair
from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.status import Status

pytestmark = [pytest.mark.slow, pytest.mark.parametrize("method", METHODS)]


def _assert_equals_local_registration(method, shift, tolerance):
    """Compare registrations in map coordinates and about the local origins."""
    source_points, target_points = source(method) + shift, target() + shift
    mapped = register(source=source_points, target=target_points, method=method)
    clouds = [PointCloud.from_array(scan) for scan in (source_points, target_points)]
    between = Pose(np.eye(3), clouds[0].origin - clouds[1].origin)
    local = register_pair((cloud.points for cloud in clouds), method=method, initial=between)
    assert local.status is mapped.status is Status.OK
    expected = local.target_from_source.apply(clouds[0].points) + clouds[1].origin
    differences = np.linalg.norm(mapped.target_from_source.apply(source_points) - expected, axis=1)
    assert differences.max() < tolerance
    truth = motion(method).apply(source(method)) + shift
    error = np.linalg.norm(mapped.target_from_source.apply(source_points) - truth, axis=1)
    assert np.median(error) < 2 * METRES
    return mapped


def test_map_coordinates_of_millions_give_the_local_pose(method):
    # Coordinates of millions, and the translation of the pose, are rounded to 1e-9 m.
    mapped = _assert_equals_local_registration(
        method, np.array([500_000.0, 5_400_000.0, 100.0]), 1e-6
    )
    assert any("computed about the origin" in note for note in mapped.notes)


def test_matrices_of_a_result_can_be_applied_by_other_tools(method):
    shift = np.array([500_000.0, 5_400_000.0, 100.0])
    source_points = source(method) + shift
    found = register(source=source_points, target=target() + shift, method=method)
    transformed = found.target_from_source.apply(source_points)
    result = json.loads(found.to_json())
    homogeneous = np.column_stack([source_points, np.ones(len(source_points))])
    for matrix in (result["target_from_source"], np.array(result["target_from_source"])):
        assert np.abs((homogeneous @ np.array(matrix).T)[:, :3] - transformed).max() < 1e-6
    # In local frames, single precision is sufficient.
    origins = np.array(result["source_origin"]), np.array(result["target_origin"])
    local = np.array(result["local_target_from_source"])
    centred = source_points - origins[0]
    for dtype, tolerance in ((np.float64, 1e-6), (np.float32, 1e-3)):
        moved = centred.astype(dtype) @ local[:3, :3].astype(dtype).T + local[:3, 3].astype(dtype)
        assert np.abs(moved + origins[1] - transformed).max() < tolerance
    assert np.array_equal(local, found.local_target_from_source.matrix)
    # The reported motion is that of the centroid.
    centroid = source_points.mean(axis=0)
    np.testing.assert_allclose(result["source_centroid"], centroid, atol=1e-6)
    centroid_shift = found.target_from_source.apply(centroid) - centroid
    np.testing.assert_allclose(result["centroid_shift_m"], centroid_shift, atol=1e-6)
    shown = str(found).splitlines()
    [translation] = [line for line in shown if line.startswith("translation")]
    assert f"{np.linalg.norm(centroid_shift):.3f} m: " in translation
    assert "at the centroid" in translation


@pytest.mark.parametrize("shift", [(500.0, 300.0, 20.0), (5000.0, -4000.0, 100.0)])
def test_map_coordinates_of_kilometres_give_the_local_pose(method, shift):
    _assert_equals_local_registration(method, np.array(shift), 1e-6)


def test_the_registration_starts_at_the_initial_pose(method):
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    source_points = far.inverse().apply(street(2))
    # 150 degrees are outside the basin of convergence of the identity.
    assert (
        register(source=source_points, target=target(), method=method).ok == TRAITS[method].searches
    )
    for initial in (far.matrix, far, far.matrix[:3], far.matrix.tolist()):
        found = register(source=source_points, target=target(), method=method, initial=initial)
        assert found.status is Status.OK
        assert any(
            step.pose.is_close(far, translation=1e-12, rotation=1e-12)
            for step in (found.history if TRAITS[method].searches else found.history[:1])
        )
        assert found.target_from_source.is_close(far, translation=METRES, rotation=RADIANS)


def test_an_initial_pose_between_map_coordinates_is_used(method):
    # The clouds are kilometres apart in the map, so a pose between their own origins differs.
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    here = Pose(np.eye(3), np.array([500_000.0, 5_400_000.0, 100.0]))
    there = Pose(np.eye(3), np.array([503_000.0, 5_398_000.0, 120.0]))
    truth = here @ far @ there.inverse()
    source_points = there.apply(far.inverse().apply(street(2)))
    found = register(
        source=source_points, target=here.apply(target()), method=method, initial=truth
    )
    assert found.status is Status.OK
    error = found.target_from_source.apply(source_points) - truth.apply(source_points)
    assert np.median(np.linalg.norm(error, axis=1)) < 2 * METRES
