import math

import numpy as np
import pytest

from reference.distribution_pairs import voxels
from reference.point_scans import BruteForceSearch, RecordingRejection, point_scan, unit_vectors
from reference.point_tree import distances
from reference.samples import street
from scanlock.clouds.neighbours import Tessellation
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.gaussians import unpacked
from scanlock.models.surface_points import SurfacePoints
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.registration.methods.icp.correspondences import (
    NearestNeighbourSearch,
    VoxelSearch,
    cached_stages,
    find_correspondences,
    require_points,
    typical_spacing,
)
from scanlock.registration.methods.icp.distance_rejection import FixedRejection, TrimmedRejection
from scanlock.registration.methods.icp.icp import Icp
from scanlock.registration.methods.icp.transform_estimation import TransformEstimation
from scanlock.registration.methods.protocol import InsufficientData

_POSE = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.4, 0.9]))
_PLANES = TransformEstimation(algorithm="gauss-newton", residual="point-to-plane")


def _points(seed=0, count=200):
    """Target points and source points near them, some of which have no target point nearby."""
    rng = np.random.default_rng(seed)
    target = rng.uniform(-5.0, 5.0, (count, 3))
    source = np.concatenate(
        [target[: count // 2] + rng.normal(0.0, 0.3, (count // 2, 3)), rng.normal(0, 6, (50, 3))]
    )
    return target, source


def _scans(*, with_normals=False):
    """A target, and a source that is aligned with it at `_POSE`."""
    target, source = _points()
    moved = _POSE.inverse().apply(source)
    if not with_normals:
        return point_scan(target), point_scan(moved)
    rng = np.random.default_rng(9)
    return (
        point_scan(target, unit_vectors(rng, len(target))),
        point_scan(moved, unit_vectors(rng, len(moved))),
    )


def _found(points, rejection=None, **options):
    target, source = points
    return find_correspondences(BruteForceSearch(target), source, rejection, **options)


def _expected(points, max_distance):
    """Distance of each correspondence within a max_distance, by all distances."""
    every = distances(*points)
    return {
        (int(row.argmin()), k): row.min()
        for k, row in enumerate(every)
        if row.min() <= max_distance
    }


def _as_set(found):
    return set(zip(found.target_rows.tolist(), found.source_rows.tolist(), strict=True))


def test_correspondences_are_nearest_points_within_the_threshold():
    points = _points()
    found = _found(points, TrimmedRejection(inlier_ratio=0.6))
    nearest = np.sort(distances(*points).min(axis=1))
    assert found.threshold == pytest.approx(nearest[math.ceil(0.6 * len(nearest)) - 1], rel=1e-12)
    expected = _expected(points, found.threshold)
    assert _as_set(found) == set(expected)
    assert 0 < len(found) == len(expected) < len(points[1])
    np.testing.assert_allclose(np.sort(found.distances), np.sort(list(expected.values())))
    assert found.mean_distance == pytest.approx(np.mean(list(expected.values())), rel=1e-12)
    np.testing.assert_array_equal(found.weights, np.ones(len(found)))


def test_without_a_rejection_all_correspondences_of_the_search_are_kept():
    points = _points()
    for options, max_distance in (({}, math.inf), ({"max_distance": 0.5}, 0.5)):
        found = _found(points, **options)
        assert _as_set(found) == set(_expected(points, max_distance))
        assert found.threshold == max_distance


def test_correspondences_are_immutable_and_count_positive_weights():
    found = _found(_points(), FixedRejection())
    weights = np.where(np.arange(len(found)) % 3 == 0, 0.0, 0.5)
    weighted = found.weighted(weights)
    assert weighted.weighted_count == np.count_nonzero(weights) < len(weighted) == len(found)
    assert found.weighted_count == len(found)
    arrays = (weighted.target_rows, weighted.source_rows, weighted.distances, weighted.weights)
    for array in arrays:
        assert not array.flags.writeable


def test_selected_correspondences_keep_their_rows_weights_and_threshold():
    found = _found(_points(), FixedRejection())
    found = found.weighted(np.linspace(0.0, 1.0, len(found)))
    mask = found.distances < 0.3
    selected = found.selected(mask)
    assert 0 < len(selected) == mask.sum() < len(found)
    for name in ("target_rows", "source_rows", "distances", "weights"):
        np.testing.assert_array_equal(getattr(selected, name), getattr(found, name)[mask])
    assert selected.threshold == found.threshold


def test_points_beyond_the_maximum_distance_do_not_enter_the_statistics():
    points = _points()
    for of_search, of_rejection in ((1.0, math.inf), (math.inf, 0.7), (0.5, 0.7)):
        rejection = RecordingRejection(thresholds=(10.0,), max_distance=of_rejection)
        found = _found(points, rejection, max_distance=of_search)
        expected = _expected(points, min(of_search, of_rejection))
        assert _as_set(found) == set(expected)
        recorded = np.sort(rejection.distances[0])
        np.testing.assert_allclose(recorded, np.sort(list(expected.values())))


def test_the_rejection_gets_the_previous_threshold_and_the_spacing():
    rejection = RecordingRejection(thresholds=(0.5,))
    assert _found(_points(), rejection, previous=0.8, spacing=0.3).threshold == 0.5
    assert (rejection.previous, rejection.spacings) == ([0.8], [0.3])


def test_the_threshold_is_bounded():
    points = _points()
    wide = FixedRejection(max_correspondence_distance=2.0)
    bounded = _found(points, wide, max_threshold=0.4)
    assert bounded.threshold == 0.4
    assert _as_set(bounded) == set(_expected(points, 0.4))
    narrow = FixedRejection(max_correspondence_distance=0.3)
    assert _found(points, narrow, max_threshold=0.4).threshold == 0.3
    assert _found(points, max_threshold=0.4).threshold == 0.4


def test_without_points_in_range_there_are_no_correspondences():
    target, source = _points()
    rejection = RecordingRejection(thresholds=(1.0,))
    found = _found((target, source + 100.0), rejection, max_distance=10.0, previous=0.7)
    assert len(found) == len(found.weights) == len(found.source_rows) == 0
    assert math.isnan(found.mean_distance)
    assert found.threshold == 0.7
    assert rejection.previous == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("limit_deg", [20.0, 60.0, 85.0])
def test_correspondences_are_rejected_by_the_angle_between_normals(limit_deg, sign):
    rng = np.random.default_rng(1)
    points, angles = rng.uniform(-5.0, 5.0, (18, 3)), np.arange(2.5, 90.0, 5.0)
    normals = unit_vectors(rng, 18)
    across = np.cross(normals, unit_vectors(rng, 18))
    across /= np.linalg.norm(across, axis=1)[:, None]
    # A rotation about an axis perpendicular to the normal turns the normal by the same angle.
    rotated = [
        exp_rotation(math.radians(angle) * axis) @ normal
        for angle, axis, normal in zip(angles, across, normals, strict=True)
    ]
    order = rng.permutation(18)
    target = point_scan(points[order], normals[order])
    source = point_scan(_POSE.inverse().apply(points), sign * np.array(rotated) @ _POSE.rotation)
    method = Icp(rejection=FixedRejection(), max_normal_angle=math.radians(limit_deg))
    found = method.correspondences(target, source, _POSE)
    np.testing.assert_array_equal(found.source_rows, np.flatnonzero(angles < limit_deg))
    np.testing.assert_array_equal(order[found.target_rows], found.source_rows)


def test_robust_weights_apply_to_the_residual_that_is_minimised():
    target, source = _scans(with_normals=True)
    robust = RobustWeights(loss="cauchy", scale=0.2)
    to_points = Icp(rejection=FixedRejection(), robust=robust)
    by_distance = to_points.correspondences(target, source, _POSE)
    rows = by_distance.target_rows, by_distance.source_rows
    differences = _POSE.apply(source.points)[rows[1]] - target.points[rows[0]]
    lengths = np.linalg.norm(differences, axis=1)
    np.testing.assert_allclose(by_distance.weights, 1.0 / (1.0 + (lengths / 0.2) ** 2))
    to_planes = Icp(rejection=FixedRejection(), robust=robust, estimation=_PLANES)
    by_plane = to_planes.correspondences(target, source, _POSE)
    offsets = (differences * target.normals[rows[0]]).sum(axis=1)
    np.testing.assert_allclose(by_plane.weights, 1.0 / (1.0 + (offsets / 0.2) ** 2))
    # The mean distance depends neither on the residual nor on the weights.
    assert by_plane.mean_distance == by_distance.mean_distance
    assert by_plane.mean_distance == pytest.approx(lengths.mean())


def test_a_scale_from_the_median_is_that_of_the_kept_correspondences():
    method = Icp(
        rejection=FixedRejection(max_correspondence_distance=0.4),
        robust=RobustWeights(loss="huber"),
    )
    found = method.correspondences(*_scans(), _POSE)
    kept = np.array(sorted(_expected(_points(), 0.4).values()))
    scale = 1.345 * 1.4826 * np.median(kept)
    np.testing.assert_allclose(np.sort(found.weights)[::-1], np.minimum(1.0, scale / kept))


@pytest.mark.parametrize("estimation", [TransformEstimation(), _PLANES], ids=["points", "planes"])
def test_if_all_normals_differ_there_are_no_correspondences(estimation):
    points = np.random.default_rng(2).uniform(-5.0, 5.0, (20, 3))
    target = point_scan(points, np.tile([0.0, 0.0, 1.0], (20, 1)))
    source = point_scan(points, np.tile([1.0, 0.0, 0.0], (20, 1)))
    method = Icp(max_normal_angle=1.0, robust=RobustWeights(loss="huber"), estimation=estimation)
    none = method.correspondences(target, source, Pose.identity(), 0.7, 3.0)
    assert len(none) == len(none.weights) == 0
    assert math.isnan(none.mean_distance)


def test_infinite_distances_and_a_right_angle_are_valid_settings():
    unlimited = Icp(
        rejection=FixedRejection(),
        max_correspondence_distance=math.inf,
        max_normal_angle=math.pi / 2,
    )
    found = unlimited.correspondences(*_scans(with_normals=True), _POSE)
    assert _as_set(found) == set(_expected(_points(), 1.0))


def _surface(count=400):
    """A tree of points, and these points with random covariances."""
    tree = PointTree.from_points(street(3, count))
    rng = np.random.default_rng(5)
    factors = rng.normal(size=(len(tree), 3, 3))
    full = factors @ factors.transpose(0, 2, 1)
    packed = full[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return tree, SurfacePoints(tree.points, packed)


@pytest.mark.parametrize("algorithm", ["k-d tree", "delaunay"])
def test_nearest_neighbour_stages_differ_in_their_distance_only(algorithm):
    search = NearestNeighbourSearch(max_correspondence_distances=(4.0, 0.5), algorithm=algorithm)
    tree, surface = _surface()
    stages = search.stages(tree, surface, 0.3)
    assert search.scales == (4.0, 0.5)
    assert isinstance(stages[0].closest, PointTree if algorithm == "k-d tree" else Tessellation)
    for stage, distance in zip(stages, search.scales, strict=True):
        assert (stage.scale, stage.max_distance, stage.spacing) == (distance, distance, 0.3)
        assert stage.surface is surface
        assert stage.closest is stages[0].closest


def test_voxel_stages_find_the_voxel_that_contains_a_point():
    tree, surface = _surface()
    queries = street(4, 300)
    for size, stage in zip(
        (8.0, 2.0),
        VoxelSearch(voxel_sizes=(8.0, 2.0)).stages(tree, surface, 0.3),
        strict=True,
    ):
        assert (stage.scale, stage.max_distance, stage.spacing) == (size, math.inf, size)
        expected = voxels(surface.points, unpacked(surface.covariances), size)
        rows, found = stage.closest.nearest(queries)
        voxel_indices = [tuple(np.floor(query / size)) for query in queries]
        np.testing.assert_array_equal(
            rows >= 0, [voxel_index in expected for voxel_index in voxel_indices]
        )
        assert (rows >= 0).sum() > 20
        for query, voxel_index, row, distance in zip(
            queries, voxel_indices, rows, found, strict=True
        ):
            if row < 0:
                assert distance == math.inf
                continue
            mean, covariance = expected[voxel_index]
            np.testing.assert_allclose(stage.closest.points[row], mean, atol=1e-9)
            np.testing.assert_allclose(
                unpacked(stage.surface.covariances[row : row + 1])[0], covariance, atol=1e-9
            )
            assert distance == pytest.approx(math.dist(query, mean), abs=1e-9)


def test_voxels_with_a_mean_beyond_the_maximum_distance_are_not_found():
    tree, surface = _surface()
    (stage,) = VoxelSearch(voxel_sizes=(4.0,)).stages(tree, surface, 0.3)
    queries = street(4, 300)
    rows, found = stage.closest.nearest(queries)
    near, near_distances = stage.closest.nearest(queries, 1.0)
    is_near = found < 1.0
    assert 0 < is_near.sum() < (rows >= 0).sum()
    np.testing.assert_array_equal(near, np.where(is_near, rows, -1))
    np.testing.assert_array_equal(near_distances, np.where(is_near, found, math.inf))


def test_cached_stages_share_one_search_and_find_the_same():
    tree, surface = _surface()
    stages = NearestNeighbourSearch().stages(tree, surface, 0.3)
    cached = cached_stages(stages)
    assert cached[0].closest is cached[2].closest is not stages[0].closest
    for shift in (0.0, 0.1, 0.5):
        queries = street(4, 300) + shift
        for one, other in zip(cached, stages, strict=True):
            rows, found = one.closest.nearest(queries, one.max_distance)
            expected_rows, expected = other.closest.nearest(queries, one.max_distance)
            np.testing.assert_array_equal(rows, expected_rows)
            np.testing.assert_array_equal(found, expected)
    in_voxels = VoxelSearch().stages(tree, surface, 0.3)
    for one, other in zip(cached_stages(in_voxels), in_voxels, strict=True):
        assert one.closest is other.closest


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (
            lambda: NearestNeighbourSearch(max_correspondence_distances=()),
            r"max_correspondence_distances must be descending and not empty, got \(\)",
        ),
        (
            lambda: NearestNeighbourSearch(max_correspondence_distances=(1.0, 2.0)),
            "max_correspondence_distances must be descending and not empty",
        ),
        (
            lambda: NearestNeighbourSearch(max_correspondence_distances=(1.0, -1.0)),
            "max_correspondence_distances must be positive, got -1.0 m",
        ),
        (
            lambda: NearestNeighbourSearch(algorithm="octree"),
            "algorithm must be 'k-d tree' or 'delaunay', got 'octree'",
        ),
        (
            lambda: VoxelSearch(voxel_sizes=(1.0, 4.0)),
            "voxel_sizes must be descending and not empty",
        ),
        (lambda: VoxelSearch(voxel_sizes=(0.0,)), "voxel_sizes must be positive, got 0.0 m"),
    ],
)
def test_invalid_settings_raise(build, message):
    with pytest.raises(InvalidInput, match=message):
        build()


def test_fewer_than_ten_points_are_insufficient():
    require_points(10)
    with pytest.raises(InsufficientData, match="has 9 surface points; 10 are needed"):
        require_points(9, "surface points")


def _spacing(points):
    """The mean over shells of the median distance to the nearest other, from the definition."""
    by_range = sorted(points, key=lambda point: math.hypot(*point))
    nearest = [
        min(math.dist(point, other) for j, other in enumerate(by_range) if j != k)
        for k, point in enumerate(by_range)
    ]
    shells = min(10, len(nearest))
    size, longer = divmod(len(nearest), shells)
    medians = []
    for k in range(shells):
        shell, nearest = np.split(nearest, [size + (k < longer)])
        medians.append(np.median(shell))
    return np.mean(medians)


@pytest.mark.parametrize("count", [2, 7, 10, 11, 403])
def test_the_typical_spacing_follows_its_definition(count):
    points = street(5)[:count]
    found = typical_spacing(PointTree.from_points(points))
    assert found == pytest.approx(_spacing(points), rel=1e-12)


def test_distant_points_count_in_the_typical_spacing():
    # Nine of ten points are 0.1 m apart near the sensor, and one of ten a metre, far away.
    near = 0.1 * np.stack(np.meshgrid(*[np.arange(30.0)] * 2, [0.0]), -1).reshape(-1, 3)
    far = np.stack(np.meshgrid(*[np.arange(10.0)] * 2, [60.0]), -1).reshape(-1, 3)
    found = typical_spacing(PointTree.from_points(np.concatenate([near, far])))
    assert found == pytest.approx(0.9 * 0.1 + 0.1 * 1.0)


def test_the_typical_spacing_of_one_point_or_equal_points_is_zero():
    assert typical_spacing(PointTree.from_points(np.ones((1, 3)))) == 0.0
    assert typical_spacing(PointTree.from_points(np.ones((25, 3)))) == 0.0
