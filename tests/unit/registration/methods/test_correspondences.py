import math

import numpy as np
import pytest

from reference.point_scans import SpyingGate, point_scan, unit_vectors
from reference.point_tree import distances
from reference.samples import street
from scanlock.clouds.point_tree import PointTree
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.optimisation.objectives.robust_weights import RobustWeights
from scanlock.registration.methods.correspondences import CorrespondenceFinder, typical_spacing
from scanlock.registration.methods.rejection import FixedRejection, TrimmedRejection

_POSE = Pose.from_step(np.array([1.0, -2.0, 0.5, 0.2, -0.4, 0.9]))


def _scans(seed=0, count=200, *, with_normals=False):
    """A target, and a source that lies near it at `_POSE`, with points of its own."""
    rng = np.random.default_rng(seed)
    target = rng.uniform(-5.0, 5.0, (count, 3))
    placed = np.concatenate(
        [target[: count // 2] + rng.normal(0.0, 0.3, (count // 2, 3)), rng.normal(0, 6, (50, 3))]
    )
    source = _POSE.inverse().apply(placed)
    if not with_normals:
        return point_scan(target), point_scan(source)
    return (
        point_scan(target, unit_vectors(rng, len(target))),
        point_scan(source, unit_vectors(rng, len(source))),
    )


def _paired(settings, scans, previous=math.inf, most=math.inf, residual="point-to-point"):
    return settings.find(*scans, _POSE, previous, most, residual)


def _expected(scans, limit):
    """Partner and distance of each source point with one within the limit, by all distances."""
    every = distances(scans[0].points, _POSE.apply(scans[1].points))
    return {(int(row.argmin()), k): row.min() for k, row in enumerate(every) if row.min() <= limit}


def _as_set(pairs):
    return set(zip(pairs.target_rows.tolist(), pairs.source_rows.tolist(), strict=True))


def test_pairs_are_of_the_closest_points_within_the_limit():
    scans = _scans()
    pairs = _paired(
        CorrespondenceFinder(
            rejection=TrimmedRejection(inlier_ratio=0.6), max_correspondence_distance=math.inf
        ),
        scans,
    )
    gaps = np.sort(distances(scans[0].points, _POSE.apply(scans[1].points)).min(axis=1))
    assert pairs.threshold == pytest.approx(gaps[math.ceil(0.6 * len(gaps)) - 1], rel=1e-12)
    expected = _expected(scans, pairs.threshold)
    assert _as_set(pairs) == set(expected)
    assert 0 < len(pairs) == len(expected) < len(scans[1].points)
    assert pairs.mean_distance == pytest.approx(np.mean(list(expected.values())), rel=1e-12)
    np.testing.assert_array_equal(pairs.weights, np.ones(len(pairs)))


def test_pairs_are_frozen_and_count_those_with_weight():
    points = np.random.default_rng(4).normal(size=(40, 3))
    pairing = CorrespondenceFinder(
        rejection=FixedRejection(), robust=RobustWeights(loss="tukey", scale=0.1)
    )
    moved = points.copy()
    moved[:15, 2] += 0.2
    scans = point_scan(points), point_scan(moved)
    pairs = pairing.find(*scans, Pose.identity(), np.inf, np.inf, "point-to-point")
    assert pairs.effective == np.count_nonzero(pairs.weights) < len(pairs) == 40
    for array in (pairs.target_rows, pairs.source_rows, pairs.weights):
        assert not array.flags.writeable


def test_points_out_of_reach_enter_no_statistics():
    scans = _scans()
    for reach, of_gate in ((1.0, math.inf), (math.inf, 0.7), (0.5, 0.7)):
        gate = SpyingGate(limits=(10.0,), reach=of_gate)
        pairs = _paired(
            CorrespondenceFinder(rejection=gate, max_correspondence_distance=reach), scans
        )
        expected = _expected(scans, min(reach, of_gate))
        assert _as_set(pairs) == set(expected)
        np.testing.assert_allclose(np.sort(gate.distances[0]), np.sort(list(expected.values())))


def test_the_gate_is_told_the_last_limit_and_the_spacing_of_the_target():
    target, source = _scans()
    gate = SpyingGate(limits=(0.5,))
    one = point_scan(target.points, spacing=0.3), point_scan(source.points, spacing=0.9)
    assert _paired(CorrespondenceFinder(rejection=gate), one, previous=0.8).limit == 0.5
    assert (gate.previous, gate.spacings) == ([0.8], [0.3])


def test_the_limit_may_be_held_below_what_the_gate_says():
    scans = _scans()
    held = _paired(
        CorrespondenceFinder(rejection=FixedRejection(max_correspondence_distance=2.0)),
        scans,
        most=0.4,
    )
    assert held.limit == 0.4
    assert _as_set(held) == set(_expected(scans, 0.4))
    assert (
        _paired(
            CorrespondenceFinder(rejection=FixedRejection(max_correspondence_distance=0.3)),
            scans,
            most=0.4,
        ).limit
        == 0.3
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("limit_deg", [20.0, 60.0, 85.0])
def test_pairs_are_dropped_whose_surfaces_differ_by_more_than_the_angle(limit_deg, sign):
    rng = np.random.default_rng(1)
    points, angles = rng.uniform(-5.0, 5.0, (18, 3)), np.arange(2.5, 90.0, 5.0)
    normals = unit_vectors(rng, 18)
    across = np.cross(normals, unit_vectors(rng, 18))
    across /= np.linalg.norm(across, axis=1)[:, None]
    # Turned about an axis across the normal, the normal turns by just that angle.
    turned = [
        exp_rotation(math.radians(angle) * axis) @ normal
        for angle, axis, normal in zip(angles, across, normals, strict=True)
    ]
    order = rng.permutation(18)
    target = point_scan(points[order], normals[order])
    source = point_scan(_POSE.inverse().apply(points), sign * np.array(turned) @ _POSE.rotation)
    settings = CorrespondenceFinder(
        rejection=FixedRejection(), max_normal_angle=math.radians(limit_deg)
    )
    pairs = _paired(settings, (target, source))
    np.testing.assert_array_equal(pairs.source_rows, np.flatnonzero(angles < limit_deg))
    np.testing.assert_array_equal(order[pairs.target_rows], pairs.source_rows)


def test_robust_weights_look_at_what_is_made_small():
    target, source = _scans(with_normals=True)
    robust = RobustWeights(loss="cauchy", scale=0.2)
    settings = CorrespondenceFinder(rejection=FixedRejection(), robust=robust)
    by_distance = _paired(settings, (target, source))
    rows = by_distance.target_rows, by_distance.source_rows
    gaps = _POSE.apply(source.points)[rows[1]] - target.points[rows[0]]
    lengths = np.linalg.norm(gaps, axis=1)
    np.testing.assert_allclose(by_distance.weights, 1.0 / (1.0 + (lengths / 0.2) ** 2))
    by_plane = _paired(settings, (target, source), residual="point-to-plane")
    offsets = (gaps * target.normals[rows[0]]).sum(axis=1)
    np.testing.assert_allclose(by_plane.weights, 1.0 / (1.0 + (offsets / 0.2) ** 2))
    # The mean stays that of the distances, whatever is made small and however it is weighed.
    assert by_plane.mean_distance == by_distance.mean_distance
    assert by_plane.mean_distance == pytest.approx(lengths.mean())


def test_a_scale_from_the_median_is_that_of_the_kept_pairs():
    scans = _scans()
    settings = CorrespondenceFinder(
        rejection=FixedRejection(max_correspondence_distance=0.4),
        robust=RobustWeights(loss="huber"),
    )
    pairs = _paired(settings, scans)
    kept = np.array(sorted(_expected(scans, 0.4).values()))
    scale = 1.345 * 1.4826 * np.median(kept)
    np.testing.assert_allclose(np.sort(pairs.weights)[::-1], np.minimum(1.0, scale / kept))


def test_without_a_partner_there_are_no_pairs():
    target, source = _scans()
    far = Pose.from_step(np.array([100.0, 0.0, 0.0, 0.0, 0.0, 0.0]))
    gate = SpyingGate(limits=(1.0,))
    pairs = CorrespondenceFinder(rejection=gate).find(
        target, source, far, 0.7, math.inf, "point-to-point"
    )
    assert len(pairs) == len(pairs.weights) == len(pairs.source_rows) == 0
    assert math.isnan(pairs.mean_distance)
    assert pairs.threshold == 0.7
    assert gate.previous == []


@pytest.mark.parametrize("residual", ["point-to-point", "point-to-plane"])
def test_where_every_surface_differs_there_are_no_pairs(residual):
    points = np.random.default_rng(2).uniform(-5.0, 5.0, (20, 3))
    target = point_scan(points, np.tile([0.0, 0.0, 1.0], (20, 1)))
    source = point_scan(points, np.tile([1.0, 0.0, 0.0], (20, 1)))
    settings = CorrespondenceFinder(max_normal_angle=1.0, robust=RobustWeights(loss="huber"))
    none = settings.find(target, source, Pose.identity(), 0.7, 3.0, residual)
    assert len(none) == len(none.weights) == 0
    assert math.isnan(none.mean_distance)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"reach": 0.0}, "reach must be positive, got 0.0 m"),
        ({"reach": -math.inf}, "reach must be positive, got -inf m"),
        ({"reach": math.nan}, "reach must be positive, got nan m"),
        ({"orientation": 0.0}, "orientation must lie between 0 and pi/2, .* got 0.0 rad"),
        ({"orientation": 1.6}, "orientation must lie between 0 and pi/2, .* got 1.6 rad"),
        ({"orientation": math.nan}, "orientation must lie between 0 and pi/2, .* got nan rad"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        CorrespondenceFinder(**settings)


def test_an_endless_reach_and_a_right_angle_are_settings():
    scans = _scans(with_normals=True)
    widest = CorrespondenceFinder(
        rejection=FixedRejection(),
        max_correspondence_distance=math.inf,
        max_normal_angle=math.pi / 2,
    )
    assert _as_set(_paired(widest, scans)) == set(_expected(scans, 1.0))


def test_a_scan_of_fewer_than_ten_points_says_so():
    points = np.random.default_rng(3).normal(size=(10, 3))
    assert point_scan(points).insufficient == ""
    assert point_scan(points[:9]).insufficient == "holds 9 points to pair, of 10 needed"


def _spacing(points):
    """The mean over shells of the median distance to the nearest other, from the definition."""
    by_range = sorted(points, key=lambda point: math.hypot(*point))
    nearest = [
        min(math.dist(point, other) for j, other in enumerate(by_range) if j != k)
        for k, point in enumerate(by_range)
    ]
    shells = min(10, len(nearest))
    share, longer = divmod(len(nearest), shells)
    medians = []
    for k in range(shells):
        shell, nearest = np.split(nearest, [share + (k < longer)])
        medians.append(np.median(shell))
    return np.mean(medians)


@pytest.mark.parametrize("count", [2, 7, 10, 11, 403])
def test_the_spacing_is_that_of_its_definition(count):
    points = street(5)[:count]
    found = typical_spacing(PointTree.from_points(points))
    assert found == pytest.approx(_spacing(points), rel=1e-12)


def test_the_spacing_speaks_of_far_points_too():
    # Nine of ten points are 0.1 m apart near the sensor, and one of ten a metre, far away.
    near = 0.1 * np.stack(np.meshgrid(*[np.arange(30.0)] * 2, [0.0]), -1).reshape(-1, 3)
    far = np.stack(np.meshgrid(*[np.arange(10.0)] * 2, [60.0]), -1).reshape(-1, 3)
    found = typical_spacing(PointTree.from_points(np.concatenate([near, far])))
    assert found == pytest.approx(0.9 * 0.1 + 0.1 * 1.0)


def test_one_point_has_no_spacing_and_equal_points_one_of_zero():
    assert typical_spacing(PointTree.from_points(np.ones((1, 3)))) == 0.0
    assert typical_spacing(PointTree.from_points(np.ones((25, 3)))) == 0.0
