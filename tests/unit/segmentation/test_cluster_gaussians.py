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

_RADII = [6.0, 6.0, 3.0, 1.5]


@pytest.fixture(scope="module")
def marks():
    return ClusterGaussianExtractor().find(PointCloud.from_array(street(1)), _RADII)


def test_the_ground_is_gone_and_the_rest_is_kept(marks):
    above = street(1)[:, 2] > -1.0
    assert above.sum() <= len(marks.obstacles) < 0.8 * len(marks.cloud)
    assert (marks.obstacles[:, 2] > -1.0).sum() == above.sum()
    assert not marks.obstacles.flags.writeable
    [note] = marks.notes
    assert note.startswith("ground found")
    assert f"{len(marks.gaussians[-1])} Gaussians" in note
    assert set(marks.timings) == {"ground", "obstacles", "clusters"}


def test_there_is_one_set_of_gaussians_for_each_scale(marks):
    assert len(marks.gaussians) == len(_RADII)
    counts = [len(some) for some in marks.gaussians]
    assert counts == sorted(counts)
    for radius, some in zip(_RADII, marks.gaussians, strict=True):
        # No point farther from the mean than the radius: no deviation larger either.
        assert np.sqrt(some.max_variances.max()) <= radius
        assert np.sqrt(some.variances.min()) >= 0.1 * (1 - 1e-9)
        assert some.counts.min() >= 6


def test_clusters_are_those_that_the_segmenter_finds(marks):
    finder = ClusterFinder(max_radius=1.5)
    labels, _ = finder.label(marks.obstacles)
    expected = Gaussians.from_labels(marks.obstacles, labels)
    found = marks.gaussians[-1]
    order, expected_order = (np.lexsort(some.means.T) for some in (found, expected))
    np.testing.assert_allclose(found.means[order], expected.means[expected_order], rtol=1e-12)
    np.testing.assert_array_equal(found.counts[order], expected.counts[expected_order])


def test_without_ground_cubes_take_the_place_of_clusters():
    rng = np.random.default_rng(2)
    cloud = rng.uniform(-8.0, 8.0, (4000, 3))
    marks = ClusterGaussianExtractor().find(PointCloud.from_array(cloud), [3.0])
    np.testing.assert_array_equal(marks.obstacles, cloud)
    labels, _ = voxel_labels(cloud, 3.0)
    expected = Gaussians.from_labels(cloud, labels, 6).regularised(0.1)
    np.testing.assert_array_equal(marks.gaussians[0].means, expected.means)
    np.testing.assert_array_equal(marks.gaussians[0].covariances, expected.covariances)
    assert marks.notes[0].startswith("ground none")


def test_a_scan_without_parts_has_empty_gaussians():
    marks = ClusterGaussianExtractor().find(PointCloud.from_array(np.eye(3)), _RADII)
    assert [len(some) for some in marks.gaussians] == [0, 0, 0, 0]


def test_settings_out_of_range_are_refused_by_name():
    with pytest.raises(InvalidInput, match=r"deviation_floor must be positive, got 0\.0 m"):
        ClusterGaussianExtractor(min_deviation=0.0)
    single = Segmenter(clusters=ClusterFinder(min_points=1))
    with pytest.raises(InvalidInput, match="least_count must be at least 2, got 1"):
        ClusterGaussianExtractor(segmenter=single)
