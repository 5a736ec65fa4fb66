import itertools

import numpy as np
import pytest

from reference.grouping import partition
from reference.samples import street
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.segmentation.clusters import ClusterFinder
from scanlock.segmentation.ground.finder import GroundStatus
from scanlock.segmentation.segmentation import Segmentation, Segmenter, segment


@pytest.fixture(scope="module")
def scan():
    return street(3, 5000)


def _with_invalid_rows(points):
    """Points with a row of NaN or Inf before every tenth, and the indices of those rows."""
    rows = np.arange(0, len(points), 10)
    invalid = np.resize([np.nan, np.inf, -np.inf], (len(rows), 3))
    invalid[::2, 1:] = 0.0
    return np.insert(points, rows, invalid, axis=0), rows + np.arange(len(rows))


def test_every_row_gets_one_label(scan):
    found = segment(scan)
    assert isinstance(found, Segmentation)
    assert found.labels.shape == (len(scan),)
    assert found.labels.dtype == np.int64
    assert not found.labels.flags.writeable
    np.testing.assert_array_equal(np.unique(found.labels), np.arange(-1, found.cluster_count + 1))
    # The scene has boxes, poles and flat ground; the feet of objects may be ground.
    assert found.ground.status is GroundStatus.FOUND
    on_ground = np.abs(scan[:, 2] + 1.7) < 0.1
    assert found.is_ground[on_ground].mean() > 0.95
    assert not found.is_ground[scan[:, 2] > -1.0].any()
    assert found.cluster_count >= 20


def test_clusters_are_the_rows_of_their_labels(scan):
    found = segment(scan)
    assert len(found.clusters) == found.cluster_count
    for number, rows in enumerate(found.clusters, start=1):
        np.testing.assert_array_equal(rows, np.flatnonzero(found.labels == number))
        assert len(rows) >= 6


def test_rows_that_are_not_finite_have_no_label_and_change_no_other(scan):
    extended, rows = _with_invalid_rows(scan)
    found = segment(extended)
    assert found.labels.shape == (len(extended),)
    np.testing.assert_array_equal(found.labels[rows], -1)
    assert np.isnan(found.height[rows]).all()
    assert not found.is_ground[rows].any()
    kept = np.delete(np.arange(len(extended)), rows)
    np.testing.assert_array_equal(found.labels[kept], segment(scan).labels)


def test_labels_follow_the_order_of_the_rows(scan):
    found = segment(scan)
    for seed in range(2):
        order = np.random.default_rng(seed).permutation(len(scan))
        shuffled = segment(scan[order])
        restored = np.empty_like(shuffled.labels)
        restored[order] = shuffled.labels
        np.testing.assert_array_equal(restored == 0, found.labels == 0)
        np.testing.assert_array_equal(restored == -1, found.labels == -1)
        assert partition(restored) == partition(found.labels)


def test_layout_and_further_columns_do_not_matter(scan):
    wide = np.column_stack([scan, np.arange(len(scan))])
    expected = segment(scan).labels
    for given in (
        np.asfortranarray(scan),
        wide,
        np.repeat(wide, 2, axis=0)[::2],
        scan.tolist(),
        scan.astype(">f8"),
        PointCloud.from_array(scan),
    ):
        np.testing.assert_array_equal(segment(given).labels, expected)


def test_single_precision_gives_the_labels_of_the_rounded_points(scan):
    single = scan.astype(np.float32)
    np.testing.assert_array_equal(segment(single).labels, segment(single.astype(float)).labels)


def test_the_scan_is_not_changed_or_frozen(scan):
    given = scan.copy()
    segment(given)
    np.testing.assert_array_equal(given, scan)
    assert given.flags.writeable


def test_a_scan_without_ground_has_a_status_and_a_reason():
    rng = np.random.default_rng(4)
    found = segment(rng.uniform(-8.0, 8.0, (3000, 3)))
    assert found.ground.status is GroundStatus.NONE
    assert not found.is_ground.any()
    assert found.ground.reason
    assert np.isnan(found.height).all()
    assert found.labels.shape == (3000,)


@pytest.mark.parametrize("count", [1, 2, 3, 50])
def test_few_or_identical_points_are_labelled(count):
    for points in (np.full((count, 3), 2.0), np.eye(3)[np.arange(count) % 3] * 9.0):
        found = segment(points)
        assert found.labels.shape == (count,)
        assert not found.is_ground.any()
        assert sum(map(len, found.clusters)) == (found.labels > 0).sum()


def test_settings_are_used_by_both_steps(scan):
    none = segment(scan, Segmenter(clusters=ClusterFinder(min_points=10**6)))
    assert none.cluster_count == 0
    assert none.clusters == ()
    np.testing.assert_array_equal(none.is_ground, segment(scan).is_ground)


def test_a_scan_of_a_tilted_sensor_has_the_same_clusters(scan):
    # Rotated about y by 22.5 degrees, more than the threshold of a level sensor.
    c, s = np.cos(np.pi / 8), np.sin(np.pi / 8)
    tilted = scan @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    found = segment(tilted)
    assert found.ground.status is GroundStatus.TILTED
    level = segment(scan)
    # Bins rotate slightly with the estimated normal: boundaries move, but no object is lost.
    assert (found.is_ground == level.is_ground).mean() > 0.98
    assert abs(found.cluster_count - level.cluster_count) <= 0.2 * level.cluster_count


@pytest.mark.parametrize(
    "points", [np.zeros((3, 2)), np.empty((0, 3)), np.full((2, 3), np.nan), "scan", None]
)
def test_invalid_scans_are_rejected(points):
    with pytest.raises(InvalidInput, match="points"):
        segment(points)


def test_clusters_are_disjoint(scan):
    found = segment(scan)
    for first, second in itertools.combinations(found.clusters[:10], 2):
        assert set(first).isdisjoint(second)


def test_points_without_a_return_are_not_a_cluster(scan):
    plain = segment(scan)
    with_placeholders = segment(np.vstack([np.zeros((4000, 3)), scan]))
    assert (with_placeholders.labels[:4000] == -1).all()
    np.testing.assert_array_equal(with_placeholders.labels[4000:] > 0, plain.labels > 0)
