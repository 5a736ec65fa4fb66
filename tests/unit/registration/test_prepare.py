import math

import numpy as np
import pytest

from reference.pairs import register_pair
from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.registration.methods.sgc_ndt import SgcNdt
from scanlock.registration.prepare import prepare
from scanlock.registration.register import register
from scanlock.registration.registry import METHODS
from scanlock.registration.verification.features import extract_features
from scanlock.registration.verification.status import Status

_MOTION = yaw_pose(0.2, (2.0, -1.0, 0.1))


@pytest.fixture(scope="module")
def scans():
    return _MOTION.inverse().apply(street(2)), street(1)


def test_a_prepared_scan_gives_the_result_of_the_scan(scans):
    source, target = scans
    whole = register(source=source, target=target)
    ready = [prepare(scan) for scan in scans]
    for pair in (ready, (source, ready[1]), (ready[0], target)):
        result = register_pair(pair)
        assert result.target_from_source == whole.target_from_source
        assert result.notes == whole.notes
        assert result.method == whole.method
    assert "ground" not in register_pair(ready).timings
    assert "ground" in register(source=source, target=ready[1]).timings


def test_a_scan_prepared_by_another_method_raises(scans):
    source, target = scans
    ready = prepare(target, method="sgc-ndt-p2d")
    assert register(source=source, target=ready).method == "sgc-ndt-p2d"
    with pytest.raises(InvalidInput, match=r"prepared the scan \(sgc-ndt-p2d\), got sgc-ndt-d2d"):
        register(source=source, target=ready, method="sgc-ndt-d2d")
    with pytest.raises(InvalidInput, match="prepared the scan"):
        register(source=source, target=ready, method=SgcNdt(score="p2d", voxel_size=0.3))
    assert register(source=source, target=ready, method=SgcNdt(score="p2d")).ok


def test_a_prepared_scan_has_data_notes_and_the_reason_without_data():
    ready = prepare(np.insert(street(1), 7, np.nan, axis=0) + 1e5)
    assert type(ready.data) is type(METHODS["auto"].prepare(ready.cloud))
    assert ready.insufficient == ""
    assert ready.notes[0] == "1 rows with NaN or Inf left out"
    assert ready.notes[1].startswith("computed about the origin")
    assert sum(note.startswith("ground found") for note in ready.notes) == 1
    short = prepare(np.eye(3))
    assert short.data is None
    assert short.insufficient.startswith("has 0 Gaussians above the ground; 4 are needed")
    assert short.features is None


def test_verification_features_are_clusters_or_voxels():
    ready = prepare(street(1))
    found = extract_features(ready.cloud)
    np.testing.assert_array_equal(found.gaussians.means, ready.features.gaussians.means)
    rng = np.random.default_rng(0)
    bare = np.column_stack([rng.uniform(-30, 30, (20000, 2)), rng.normal(-1.7, 0.02, 20000)])
    voxels = extract_features(prepare(bare).cloud)
    assert len(voxels.gaussians) > 1000
    assert (
        voxels.notes[-1]
        == f"too few clusters: verified with {len(voxels.gaussians)} voxel Gaussians"
    )


def test_a_prior_in_map_coordinates_equals_one_in_local_frames(scans):
    # The same registration twice: in map coordinates, and in coordinates about the origins.
    here = Pose(np.eye(3), np.array([500_000.0, 5_400_000.0, 100.0]))
    mean = yaw_pose(0.25, (2.5, -1.0, 0.1))
    covariance = np.diag([0.01, 0.01, 0.01, 1e-4, 1e-4, 1e-4])
    source, target = (PointCloud.from_array(here.apply(scan)) for scan in scans)
    prior = PosePrior(here @ mean @ here.inverse(), covariance)
    mapped = register(source=source, target=target, prior=prior, method="sgc-ndt-d2d")
    between = Pose(mean.rotation, mean.apply(source.origin - here.translation))
    shifted = Pose(between.rotation, between.translation + here.translation - target.origin)
    local = register(
        source=source.points,
        target=target.points,
        initial=Pose(np.eye(3), source.origin - target.origin),
        prior=PosePrior(shifted, covariance),
        method="sgc-ndt-d2d",
    )
    found = mapped.target_from_source.apply(source.points + source.origin)
    expected = local.target_from_source.apply(source.points) + target.origin
    assert np.abs(found - expected).max() < 1e-6
    # The prior has an effect: without it the pose is farther from the mean.
    free = register(source=source, target=target, method="sgc-ndt-d2d")
    local_poses = [here.inverse() @ one.target_from_source @ here for one in (mapped, free)]
    with_prior, without = (pose.distance(mean)[0] for pose in local_poses)
    assert with_prior < 0.97 * without


def test_locked_directions_keep_their_initial_values(scans):
    source, target = scans
    initial = Pose.from_step(np.array([0.0, 0.0, 0.2, 0.02, -0.01, 0.0]))
    result = register(source=source, target=target, initial=initial, dof="xy+yaw")
    pose = result.target_from_source
    assert abs(pose.translation[2] - 0.2) < 1e-9
    vertical = (pose.rotation @ initial.rotation.T)[2]
    np.testing.assert_allclose(vertical, [0.0, 0.0, 1.0], atol=1e-9)
    level = register(source=source, target=target, dof="xyz+yaw")
    assert level.status is Status.OK
    assert level.target_from_source.is_close(_MOTION, translation=0.1, rotation=math.radians(0.3))
    with pytest.raises(InvalidInput, match="dof must be one of"):
        register(source=source, target=target, dof="yaw")
