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


def test_poses_go_to_local_frames_and_back_without_losing_a_micrometre():
    truth = Pose(exp_rotation(np.array([0.02, -0.01, 0.4])), [1.0, -2.0, 0.3])
    # The same motion between the callers' frames, both far from their origins.
    to_target, to_source = Pose(np.eye(3), _UTM), Pose(np.eye(3), _UTM + np.array([300, -200, 5]))
    target_from_source = to_target @ truth @ to_source.inverse()
    source_array = _XYZ + to_source.translation
    target_array = truth.apply(_XYZ) + to_target.translation
    source, target = PointCloud.from_array(source_array), PointCloud.from_array(target_array)

    frames = LocalOrigins.of_clouds(target, source)
    local = frames.local(target_from_source)
    assert np.abs(local.translation).max() < 1000.0
    np.testing.assert_allclose(local.apply(source.points), target.points, atol=1e-8)

    back = frames.caller(local)
    assert back.is_close(target_from_source, translation=1e-8, rotation=1e-12)
    np.testing.assert_allclose(back.apply(source_array), target_array, rtol=0, atol=1e-8)


def test_poses_between_sensor_frames_are_their_own_local_poses():
    rotation = Rotation.from_euler("z", 30, degrees=True).as_matrix()
    pose = Pose(rotation, [1.0, 2.0, 3.0])
    cloud = PointCloud.from_array(_XYZ)
    frames = LocalOrigins.of_clouds(cloud, cloud)
    assert frames.local(pose) == pose
    assert frames.caller(pose) == pose


@pytest.mark.parametrize(("source", "is_on_map"), [(_XYZ, False), (_XYZ + _UTM, True)])
def test_motions_are_told_of_the_sensor_or_in_a_map_of_the_centroid(source, is_on_map):
    target = PointCloud.from_array(_XYZ + _UTM)
    frames = LocalOrigins.of_clouds(target, PointCloud.from_array(source))
    assert frames.is_on_map == is_on_map
    np.testing.assert_allclose(
        frames.reference_point, source.mean(axis=0) if is_on_map else 0.0, atol=1e-6
    )
    pose = Pose(Rotation.from_euler("z", 3, degrees=True).as_matrix(), np.array([1.0, 2.0, 3.0]))
    way = frames.shift(pose, frames.reference_point)
    expected = pose.apply(frames.reference_point) - frames.reference_point
    np.testing.assert_allclose(way, expected, atol=1e-6)


def test_frames_survive_a_pickle_and_stay_read_only():
    cloud = PointCloud.from_array(_XYZ + _UTM)
    frames = LocalOrigins.of_clouds(cloud, cloud)
    again = pickle.loads(pickle.dumps(frames))
    for name in ("target_origin", "source_origin", "source_centroid"):
        np.testing.assert_array_equal(getattr(again, name), getattr(frames, name))
        assert not getattr(again, name).flags.writeable
