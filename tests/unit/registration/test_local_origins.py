import pickle

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.registration.local_origins import LocalOrigins

_XYZ = np.random.default_rng(0).integers(-4000, 4000, size=(40, 3)) / 128.0
_UTM = np.array([500_000.0, 5_400_000.0, 312.5])


def test_poses_round_trip_through_local_frames():
    truth = Pose(exp_rotation(np.array([0.02, -0.01, 0.4])), [1.0, -2.0, 0.3])
    # The same motion between map origins far from their origins.
    to_target, to_source = Pose(np.eye(3), _UTM), Pose(np.eye(3), _UTM + np.array([300, -200, 5]))
    target_from_source = to_target @ truth @ to_source.inverse()
    source_array = _XYZ + to_source.translation
    target_array = truth.apply(_XYZ) + to_target.translation
    source, target = PointCloud.from_array(source_array), PointCloud.from_array(target_array)

    origins = LocalOrigins.of_clouds(target, source)
    local = origins.local(target_from_source)
    assert np.abs(local.translation).max() < 1000.0
    np.testing.assert_allclose(local.apply(source.points), target.points, atol=1e-8)

    back = origins.caller(local)
    assert back.is_close(target_from_source, translation=1e-8, rotation=1e-12)
    np.testing.assert_allclose(back.apply(source_array), target_array, rtol=0, atol=1e-8)


def test_poses_between_sensor_frames_equal_their_local_poses():
    rotation = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    pose = Pose(rotation, [1.0, 2.0, 3.0])
    cloud = PointCloud.from_array(_XYZ)
    origins = LocalOrigins.of_clouds(cloud, cloud)
    assert origins.local(pose) == pose
    assert origins.caller(pose) == pose


@pytest.mark.parametrize(("source", "is_on_map"), [(_XYZ, False), (_XYZ + _UTM, True)])
def test_the_reference_point_is_the_sensor_or_the_centroid_in_a_map(source, is_on_map):
    target = PointCloud.from_array(_XYZ + _UTM)
    origins = LocalOrigins.of_clouds(target, PointCloud.from_array(source))
    assert origins.is_on_map == is_on_map
    np.testing.assert_allclose(
        origins.reference_point, source.mean(axis=0) if is_on_map else 0.0, atol=1e-6
    )
    pose = Pose(Rotation.from_euler("z", 3, degrees=True).as_matrix(), np.array([1.0, 2.0, 3.0]))
    shift = origins.shift(pose, origins.reference_point)
    expected = pose.apply(origins.reference_point) - origins.reference_point
    np.testing.assert_allclose(shift, expected, atol=1e-6)


def test_local_origins_can_be_pickled_and_are_read_only():
    cloud = PointCloud.from_array(_XYZ + _UTM)
    origins = LocalOrigins.of_clouds(cloud, cloud)
    again = pickle.loads(pickle.dumps(origins))
    for name in ("target_origin", "source_origin", "source_centroid"):
        np.testing.assert_array_equal(getattr(again, name), getattr(origins, name))
        assert not getattr(again, name).flags.writeable
