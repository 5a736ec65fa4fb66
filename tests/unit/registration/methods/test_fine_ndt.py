import math

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.methods.fine_ndt import FineNdt
from scanlock.simulation import scan_pair

_FINE = FineNdt()


def _prepared(points, fine=_FINE):
    return fine.prepare(PointCloud.from_array(points))


@pytest.mark.slow
def test_simulated_scans_are_registered_to_millimetres():
    pair = scan_pair("street", "hdl_64e", 3, baseline=(1.0, 1.5))
    truth = pair.target_from_source
    start = yaw_pose(0.01, (0.15, -0.1, 0.05)) @ truth
    found = _FINE.align(_prepared(pair.target.points), _prepared(pair.source.points), start)
    metres, radians = found.pose.distance(truth)
    assert metres < 0.006
    assert math.degrees(radians) < 0.02


def test_a_sparse_scan_has_larger_cells_and_a_pair_the_larger_of_both():
    rng = np.random.default_rng(0)
    dense = street(1, count=60000)
    sparse = dense[rng.random(len(dense)) < 0.12]
    target, source = _prepared(dense), _prepared(sparse)
    assert target.cell_size == 1.0
    assert source.cell_size > target.cell_size
    start = yaw_pose(0.01, (0.2, -0.1, 0.05))
    found = _FINE.align(target, source, start)
    assert found.pose.is_close(Pose.identity(), translation=0.03, rotation=math.radians(0.1))
    other = _FINE.align(source, target, start.inverse())
    assert (found.pose @ other.pose).is_close(
        Pose.identity(), translation=0.01, rotation=math.radians(0.05)
    )


def test_three_grids_give_three_times_the_cells():
    scan = street(1, count=20000)
    single = _prepared(scan, FineNdt(offsets=(0.0,)))
    triple = _prepared(scan)
    assert triple.cell_size == single.cell_size
    assert 2.5 < len(triple.gaussians) / len(single.gaussians) < 3.5


def test_joined_gaussians_keep_their_order():
    sets = [_prepared(street(k)).gaussians for k in (1, 2)]
    both = Gaussians.joined(sets)
    np.testing.assert_array_equal(both.means[len(sets[0]) :], sets[1].means)
    np.testing.assert_array_equal(both.counts[: len(sets[0])], sets[0].counts)
    np.testing.assert_allclose(both.variances, np.linalg.eigvalsh(both.covariances), atol=1e-12)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"cell_sizes": ()}, "cell_sizes must be ascending and not empty"),
        ({"cell_sizes": (2.0, 1.0)}, "cell_sizes must be ascending and not empty"),
        ({"cell_sizes": (0.0, 1.0)}, "cell_sizes must be positive, got 0.0 m"),
        ({"offsets": ()}, "offsets must not be empty"),
        ({"weight_power": -1.0}, "weight_power must be"),
        ({"shapes": ()}, "shapes must not be empty"),
        ({"coarse_tolerance": 0.0}, "coarse_tolerance must be"),
    ],
)
def test_settings_out_of_range_are_refused(settings, message):
    with pytest.raises(InvalidInput, match=message):
        FineNdt(**settings)


def test_a_large_cloud_has_one_grid_and_a_large_source_few_cells():
    scan, start = street(1, count=20000), yaw_pose(0.01, (0.2, -0.1, 0.05))
    bounded = FineNdt(max_points=10_000, max_cells=200)
    prepared = _prepared(scan, bounded)
    assert prepared.grid_count == 1
    assert prepared.gaussians is prepared.first_grid
    assert prepared.cell_size == _prepared(scan).cell_size
    found = bounded.align(prepared, prepared, start)
    assert len(prepared.gaussians) > 200
    assert found.pose.is_close(Pose.identity(), translation=0.02, rotation=math.radians(0.1))
