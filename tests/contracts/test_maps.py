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

pytestmark = pytest.mark.parametrize("method", METHODS)


def _assert_answer_is_local(method, shift, tolerance):
    """Register in map coordinates, and by hand about the origins that the clouds were given."""
    scene, reference = source(method) + shift, target() + shift
    mapped = register(source=scene, target=reference, method=method)
    clouds = [PointCloud.from_array(scan) for scan in (scene, reference)]
    between = Pose(np.eye(3), clouds[0].origin - clouds[1].origin)
    local = register_pair((cloud.points for cloud in clouds), method=method, initial=between)
    assert local.status is mapped.status is Status.OK
    expected = local.target_from_source.apply(clouds[0].points) + clouds[1].origin
    gaps = np.linalg.norm(mapped.target_from_source.apply(scene) - expected, axis=1)
    assert gaps.max() < tolerance
    right = motion(method).apply(source(method)) + shift
    error = np.linalg.norm(mapped.target_from_source.apply(scene) - right, axis=1)
    assert np.median(error) < 2 * METRES
    return mapped


def test_map_coordinates_of_millions_give_the_local_answer(method):
    # Coordinates of millions are rounded to 1e-9 m, and so is the translation of the pose.
    mapped = _assert_answer_is_local(method, np.array([500_000.0, 5_400_000.0, 100.0]), 1e-6)
    assert any("computed about the origin" in note for note in mapped.notes)


def test_any_tool_that_applies_the_matrix_in_double_precision_lands_where_scanlock_does(method):
    shift = np.array([500_000.0, 5_400_000.0, 100.0])
    scene = source(method) + shift
    found = register(source=scene, target=target() + shift, method=method)
    landed = found.target_from_source.apply(scene)
    plain = json.loads(found.to_json())
    homogeneous = np.column_stack([scene, np.ones(len(scene))])
    for matrix in (plain["target_from_source"], np.array(plain["target_from_source"])):
        assert np.abs((homogeneous @ np.array(matrix).T)[:, :3] - landed).max() < 1e-6
    # By the local frames, where single precision does too.
    origins = np.array(plain["source_origin"]), np.array(plain["target_origin"])
    local = np.array(plain["local_target_from_source"])
    near = scene - origins[0]
    for kind, tolerance in ((np.float64, 1e-6), (np.float32, 1e-3)):
        moved = near.astype(kind) @ local[:3, :3].astype(kind).T + local[:3, 3].astype(kind)
        assert np.abs(moved + origins[1] - landed).max() < tolerance
    assert np.array_equal(local, found.local_target_from_source.matrix)
    # And the way that the scan went is that of its centroid.
    centroid = scene.mean(axis=0)
    np.testing.assert_allclose(plain["source_centroid"], centroid, atol=1e-6)
    way = found.target_from_source.apply(centroid) - centroid
    np.testing.assert_allclose(plain["centroid_shift_m"], way, atol=1e-6)
    assert f"moved={np.linalg.norm(way):.3f} m" in repr(found)
    assert f"{np.linalg.norm(way):.3f} m at the centroid" in str(found)


@pytest.mark.parametrize("shift", [(500.0, 300.0, 20.0), (5000.0, -4000.0, 100.0)])
def test_map_coordinates_of_kilometres_give_the_local_answer(method, shift):
    _assert_answer_is_local(method, np.array(shift), 1e-6)


def test_an_initial_pose_is_where_the_search_begins(method):
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    scene = far.inverse().apply(street(2))
    # Two and a half right angles are beyond the basin from the identity.
    assert register(source=scene, target=target(), method=method).ok == TRAITS[method].searches
    for initial in (far.matrix, far, far.matrix[:3], far.matrix.tolist()):
        found = register(source=scene, target=target(), method=method, initial=initial)
        assert found.status is Status.OK
        assert any(
            step.pose.is_close(far, translation=1e-12, rotation=1e-12)
            for step in (found.history if TRAITS[method].searches else found.history[:1])
        )
        assert found.target_from_source.is_close(far, translation=METRES, rotation=RADIANS)


def test_an_initial_pose_in_map_coordinates_is_one_between_them(method):
    # The clouds lie kilometres apart in the map, so a start about their own origins is another.
    far = yaw_pose(2.6, (4.0, -3.0, 0.0))
    here = Pose(np.eye(3), np.array([500_000.0, 5_400_000.0, 100.0]))
    there = Pose(np.eye(3), np.array([503_000.0, 5_398_000.0, 120.0]))
    truth = here @ far @ there.inverse()
    scene = there.apply(far.inverse().apply(street(2)))
    found = register(source=scene, target=here.apply(target()), method=method, initial=truth)
    assert found.status is Status.OK
    error = found.target_from_source.apply(scene) - truth.apply(scene)
    assert np.median(np.linalg.norm(error, axis=1)) < 2 * METRES
