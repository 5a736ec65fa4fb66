import numpy as np
import pytest

from reference.samples import gaussians, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.gaussians import Gaussians
from scanlock.registration.search.cluster_features import ClusterFeatures, ClusterKind


def _cluster(*deviations, centre=(4.0, 5.0, 2.0)):
    return Gaussians.from_covariances(
        np.array([centre]), np.diag(np.square(deviations))[None], np.array([50])
    )


@pytest.mark.parametrize(
    ("deviations", "kind", "axis"),
    [
        ((0.1, 0.1, 1.5), ClusterKind.THIN, [0, 0, 1]),
        ((2.0, 0.3, 0.1), ClusterKind.THIN, [1, 0, 0]),
        ((1.5, 0.1, 1.0), ClusterKind.FLAT, [0, 1, 0]),
        ((0.5, 0.6, 0.4), ClusterKind.ROUND, [0, 0, 0]),
    ],
)
def test_clusters_are_thin_flat_or_round(deviations, kind, axis):
    features = ClusterFeatures.from_gaussians(_cluster(*deviations))
    assert features.kinds.tolist() == [kind]
    np.testing.assert_allclose(np.abs(features.axes[0]), axis, atol=1e-12)
    np.testing.assert_allclose(features.log_deviations[0], np.log(sorted(deviations)))


def test_heights_refer_to_the_levelled_frame():
    level_from_scan = Pose(exp_rotation(np.array([0.4, 0.0, 0.0])), np.array([0.0, 0.0, 1.7]))
    upright = _cluster(0.1, 0.1, 0.8)
    features = ClusterFeatures.from_gaussians(
        upright.transformed(level_from_scan.inverse()), level_from_scan
    )
    np.testing.assert_allclose(features.centres, upright.means, atol=1e-12)
    np.testing.assert_allclose(
        features.vertical_features[0], [np.log(0.8), 1.0, 2.0, 2.0 + 1.7 * 0.8]
    )
    assert features.level_from_scan is level_from_scan


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0, -1.3])
def test_the_heading_of_a_wall_rotates_with_it(angle):
    wall = _cluster(1.5, 0.2, 1.0).transformed(yaw_pose(angle, (0.0, 0.0, 0.0)))
    expected = [np.cos(2 * angle), np.sin(2 * angle)]
    np.testing.assert_allclose(
        ClusterFeatures.from_gaussians(wall).headings[0], expected, atol=1e-12
    )


@pytest.mark.parametrize("deviations", [(1.0, 0.7, 1.0), (0.4, 0.1, 2.0)])
def test_bushes_and_poles_have_no_heading(deviations):
    assert not ClusterFeatures.from_gaussians(_cluster(*deviations)).headings.any()


def test_deviations_and_kinds_are_invariant_to_rotations():
    clusters = gaussians(np.random.default_rng(1), 60)
    pose = Pose(exp_rotation(np.array([0.5, -1.0, 2.0])), np.array([3.0, 4.0, 5.0]))
    one, other = (ClusterFeatures.from_gaussians(clusters, frame) for frame in (None, pose))
    assert len(one) == 60
    assert set(one.kinds.tolist()) == set(ClusterKind)
    np.testing.assert_array_equal(one.kinds, other.kinds)
    np.testing.assert_allclose(one.log_deviations, other.log_deviations, atol=1e-9)
    rotated = one.axes @ pose.rotation.T
    np.testing.assert_allclose((rotated * other.axes).sum(1) ** 2, (one.axes**2).sum(1), atol=1e-6)


def test_a_scan_without_clusters_has_no_features():
    none = Gaussians.from_covariances(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0, np.int64))
    assert len(ClusterFeatures.from_gaussians(none)) == 0


def test_features_are_read_only():
    features = ClusterFeatures.from_gaussians(_cluster(1.0, 1.0, 1.0))
    with pytest.raises(ValueError, match="read-only"):
        features.centres[0] = 0.0
