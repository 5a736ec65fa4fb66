import numpy as np
import pytest

from reference.samples import street
from scanlock.clouds.point_cloud import PointCloud
from scanlock.clouds.voxel_grid import voxel_labels
from scanlock.errors import InvalidInput
from scanlock.models.gaussians import Gaussians
from scanlock.segmentation.cluster_gaussians import ClusterGaussianExtractor
from scanlock.segmentation.clusters import ClusterFinder
from scanlock.segmentation.segmentation import Segmenter
from scanlock.timing import StageClock

_RADII = [6.0, 6.0, 3.0, 1.5]


@pytest.fixture(scope="module")
def clusters():
    return ClusterGaussianExtractor().extract(PointCloud.from_array(street(1)), _RADII)


def test_ground_points_are_removed(clusters):
    above = street(1)[:, 2] > -1.0
    assert above.sum() <= len(clusters.obstacles) < 0.8 * len(clusters.cloud)
    assert (clusters.obstacles[:, 2] > -1.0).sum() == above.sum()
    assert not clusters.obstacles.flags.writeable
    [note] = clusters.notes
    assert note.startswith("ground found")
    assert f"{len(clusters.gaussians[-1])} Gaussians" in note
    assert clusters.insufficient_reason == ""


def test_each_stage_is_timed():
    clock = StageClock()
    ClusterGaussianExtractor().extract(PointCloud.from_array(street(1)), _RADII, clock)
    assert set(clock.seconds) == {"ground", "obstacles", "clusters"}


def test_each_scale_has_its_own_gaussians(clusters):
    assert len(clusters.gaussians) == len(_RADII)
    counts = [len(some) for some in clusters.gaussians]
    assert counts == sorted(counts)
    for radius, some in zip(_RADII, clusters.gaussians, strict=True):
        # No point is farther from the mean than the radius, so no deviation is larger either.
        assert np.sqrt(some.max_variances.max()) <= radius
        assert np.sqrt(some.variances.min()) >= 0.1 * (1 - 1e-9)
        assert some.counts.min() >= 6


def test_clusters_are_those_of_the_cluster_finder(clusters):
    finder = ClusterFinder(max_radius=1.5)
    labels, _ = finder.label(clusters.obstacles)
    expected = Gaussians.from_labels(clusters.obstacles, labels)
    found = clusters.gaussians[-1]
    order, expected_order = (np.lexsort(some.means.T) for some in (found, expected))
    np.testing.assert_allclose(found.means[order], expected.means[expected_order], rtol=1e-12)
    np.testing.assert_array_equal(found.counts[order], expected.counts[expected_order])


def test_voxels_replace_clusters_without_a_ground():
    rng = np.random.default_rng(2)
    cloud = rng.uniform(-8.0, 8.0, (4000, 3))
    clusters = ClusterGaussianExtractor().extract(PointCloud.from_array(cloud), [3.0])
    np.testing.assert_array_equal(clusters.obstacles, cloud)
    labels, _ = voxel_labels(cloud, 3.0)
    expected = Gaussians.from_labels(cloud, labels, 6).regularised(0.1)
    np.testing.assert_array_equal(clusters.gaussians[0].means, expected.means)
    np.testing.assert_array_equal(clusters.gaussians[0].covariances, expected.covariances)
    assert clusters.notes[0].startswith("ground none")


def test_a_scan_without_clusters_has_no_gaussians():
    clusters = ClusterGaussianExtractor().extract(PointCloud.from_array(np.eye(3)), _RADII)
    assert [len(some) for some in clusters.gaussians] == [0, 0, 0, 0]
    assert clusters.insufficient_reason == "has 0 Gaussians above the ground; 4 are needed"


def test_settings_out_of_range_are_refused_by_name():
    with pytest.raises(InvalidInput, match=r"min_deviation must be positive, got 0\.0 m"):
        ClusterGaussianExtractor(min_deviation=0.0)
    single = Segmenter(clusters=ClusterFinder(min_points=1))
    with pytest.raises(InvalidInput, match=r"clusters\.min_points must be at least 2, got 1"):
        ClusterGaussianExtractor(segmenter=single)


def test_each_scale_has_at_most_the_largest_number_of_gaussians():
    extractor = ClusterGaussianExtractor(max_gaussians=8)
    bounded = extractor.extract(PointCloud.from_array(street(1)), _RADII).gaussians
    every = ClusterGaussianExtractor().extract(PointCloud.from_array(street(1)), _RADII).gaussians
    for few, many in zip(bounded, every, strict=True):
        assert len(few) == min(8, len(many))
        assert sorted(few.counts) == sorted(many.counts)[-len(few) :]
