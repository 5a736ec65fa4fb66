import pickle

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import InvalidInput
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import Constraints
from scanlock.optimisation.objectives.gaussian_scores import ScoreShape
from scanlock.optimisation.solvers.criteria import StopReason
from scanlock.optimisation.solvers.levenberg_marquardt import LevenbergMarquardt
from scanlock.registration.methods.gaussian_scan import dense_scales
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.protocol import InsufficientData, PreparationLog

_NEAR = yaw_pose(0.02, (0.3, -0.2, 0.05))
_FAR = yaw_pose(0.5, (4.0, 3.0, -0.2))

_PUBLISHED = {"das2013": Ndt.das2013(), "stoyanov2012": NdtD2d.stoyanov2012()}

_DEFAULTS = {"ndt": Ndt(), "ndt-d2d": NdtD2d(), "mskm-ndt": MskmNdt()}

_VARIANTS = {
    "own": Ndt(association="own-cell"),
    "seven": Ndt(association="seven-cells"),
    "trilinear": Ndt(association="trilinear"),
    "all": Ndt(association="all"),
    "damped": Ndt(solver=LevenbergMarquardt()),
    "nearest": NdtD2d(association="nearest"),
    "cells": NdtD2d(association="cells-around"),
    "d2d damped": NdtD2d(solver=LevenbergMarquardt()),
    "k-means d2d": MskmNdt(score="d2d"),
    "k-means obstacles": MskmNdt(points="obstacles"),
    "k-means damped": MskmNdt(solver=LevenbergMarquardt()),
}


def _align(method, motion, start=None, constraints=None):
    target, source = (
        method.prepare(PointCloud.from_array(scan))
        for scan in (street(1), motion.inverse().apply(street(2)))
    )
    return method.align(target, source, start or Pose.identity(), constraints or Constraints())


@pytest.mark.parametrize("name", _DEFAULTS | _VARIANTS)
def test_a_small_motion_is_recovered(name):
    found = _align((_DEFAULTS | _VARIANTS)[name], _NEAR)
    assert found.reason.is_converged
    assert found.pose.is_close(_NEAR, translation=0.1, rotation=0.005)


@pytest.mark.parametrize("name", [*_DEFAULTS, "own", "all", "cells", "k-means damped"])
def test_coarse_to_fine_recovers_a_large_motion(name):
    found = _align((_DEFAULTS | _VARIANTS)[name], _FAR)
    assert found.reason.is_converged
    assert found.pose.is_close(_FAR, translation=0.1, rotation=0.005)


@pytest.mark.parametrize("name", _PUBLISHED)
def test_published_settings_recover_small_motions_only(name):
    assert _align(_PUBLISHED[name], _NEAR).pose.is_close(_NEAR, translation=0.15, rotation=0.01)
    far = yaw_pose(1.2, (9.0, 6.0, 0.0))
    assert not _align(_PUBLISHED[name], far).pose.is_close(far, translation=0.3, rotation=0.02)


@pytest.mark.parametrize("name", _DEFAULTS)
def test_locked_directions_are_locked_at_every_scale(name):
    start = Pose.from_step(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]))
    found = _align(_DEFAULTS[name], _NEAR, start, Constraints(dof="xy+yaw"))
    for entry in found.history:
        np.testing.assert_allclose(entry.pose.translation[2], 0.1, atol=1e-12)
        np.testing.assert_allclose(entry.pose.rotation[2], [0.0, 0.0, 1.0], atol=1e-12)
    assert np.linalg.norm(found.pose.translation[:2] - _NEAR.translation[:2]) < 0.1


@pytest.mark.parametrize("name", _DEFAULTS)
def test_distant_scans_return_the_start(name):
    start = yaw_pose(0.1, (500.0, 0.0, 0.0))
    found = _align(_DEFAULTS[name], _NEAR, start)
    assert found.reason is StopReason.EMPTY_OBJECTIVE
    assert found.pose == start


@pytest.mark.parametrize("name", _DEFAULTS | _PUBLISHED)
def test_prepare_logs_the_gaussians_and_raises_for_too_few(name):
    method, log = (_DEFAULTS | _PUBLISHED)[name], PreparationLog()
    for scan in (np.ones((1, 3)), np.full((500, 3), 2.5), np.zeros((50, 3))):
        with pytest.raises(InsufficientData, match=r"has [0-3] Gaussians; 4 are needed"):
            method.prepare(PointCloud.from_array(scan))
    method.prepare(PointCloud.from_array(street(1)), log)
    assert "Gaussians" in log.notes[0]
    assert sum(log.seconds.values()) > 0.0


@pytest.mark.parametrize("method", [Ndt, NdtD2d])
def test_sizes_with_low_coverage_are_skipped(method):
    # Half of 6000 points are in cells of 1 m with six points or more, and hardly any in smaller
    # ones.
    fine = method(cell_sizes=(8.0, 4.0, 2.0, 1.0, 0.1))
    scan = fine.prepare(PointCloud.from_array(street(1)))
    assert scan.coverage[3] < 0.6 < scan.coverage[2]
    assert _align(fine, _NEAR).pose == _align(method(cell_sizes=(8.0, 4.0, 2.0)), _NEAR).pose


def test_the_size_with_most_gaussians_is_used_if_all_have_low_coverage():
    scan = Ndt(cell_sizes=(1.0, 0.5)).prepare(PointCloud.from_array(street(1)))
    assert max(scan.coverage) < 0.6
    assert dense_scales(scan) == dense_scales(scan, scan) == [0]


def test_points_at_zero_are_removed_in_a_sensor_frame_only():
    scan = street(1)
    with_zeros = np.insert(scan, [0, 700], 0.0, axis=0)
    np.testing.assert_array_equal(PointCloud.from_array(with_zeros).measured_points, scan)
    mapped = PointCloud.from_array(scan + 5000.0)
    assert len(mapped.measured_points) == len(scan)


def test_p2d_uses_all_points_or_downsamples_them():
    cloud = PointCloud.from_array(street(1))
    assert len(Ndt(voxel_size=0.0).prepare(cloud).points) == len(cloud)
    assert 4 < len(Ndt(voxel_size=10.0).prepare(cloud).points) < 0.1 * len(cloud)


def test_the_identity_is_a_minimum_of_equal_scans():
    scan = NdtD2d().prepare(PointCloud.from_array(street(1)))
    found = NdtD2d().align(scan, scan, Pose.identity())
    assert found.pose.is_close(Pose.identity(), translation=1e-9, rotation=1e-9)


def test_the_settings_of_the_papers():
    das, stoyanov = _PUBLISHED["das2013"], _PUBLISHED["stoyanov2012"]
    assert (das.cell_sizes, das.association, das.voxel_size) == ((3.0,), "own-cell", 0.0)
    assert das.solver.criteria.gradient_tolerance == das.solver.criteria.step_tolerance == 1e-6
    assert stoyanov.cell_sizes == (2.0, 1.0, 0.5)
    assert stoyanov.shape == ScoreShape(sharpness=0.05)


@pytest.mark.parametrize("method", [*_DEFAULTS.values(), *_PUBLISHED.values()])
def test_settings_and_prepared_scans_can_be_pickled(method):
    assert pickle.loads(pickle.dumps(method)) == method
    assert hash(method) == hash(pickle.loads(pickle.dumps(method)))
    scan = method.prepare(PointCloud.from_array(street(1)))
    copy = pickle.loads(pickle.dumps(scan))
    assert method.align(copy, copy).pose == method.align(scan, scan).pose


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        (Ndt, {"cell_sizes": ()}, r"cell_sizes must be descending and not empty, got \(\)"),
        (Ndt, {"cell_sizes": (1.0, 2.0)}, "cell_sizes must be descending and not empty"),
        (NdtD2d, {"cell_sizes": (1.0, 0.0)}, r"cell_sizes must be positive, got 0\.0 m"),
        (Ndt, {"association": "nearest"}, "association must be one of own-cell, .*, all, got 'n"),
        (Ndt, {"outlier_ratio": 1.0}, "outlier_ratio must lie above 0"),
        (Ndt, {"voxel_size": -1.0}, "voxel_size must be at least 0"),
        (Ndt, {"coarse_tolerance": 2.0}, "coarse_tolerance must lie between"),
        (NdtD2d, {"association": "own-cell"}, "association must be one of nearest, cells-around"),
        (NdtD2d, {"neighbour_cells": -1}, "neighbour_cells must be a whole number"),
        (NdtD2d, {"weight_power": -1.0}, "weight_power must be at least 0"),
        (MskmNdt, {"score": "points"}, "score must be 'p2d' or 'd2d', got 'points'"),
        (MskmNdt, {"points": "ground"}, "points must be 'obstacles' or 'all', got 'ground'"),
        (MskmNdt, {"cluster_counts": (200, 100)}, "cluster_counts must be ascending"),
        (MskmNdt, {"cluster_counts": ()}, "cluster_counts must be ascending and not empty"),
        (
            MskmNdt,
            {"cluster_counts": (0, 5)},
            "cluster_counts must be a whole number of at least 1",
        ),
        (MskmNdt, {"voxel_size": 0.0}, "voxel_size must be positive"),
        (MskmNdt, {"min_points": 1}, "min_points must be"),
        (MskmNdt, {"min_deviation": 0.0}, "min_deviation must be positive"),
    ],
)
def test_invalid_settings_raise(method, settings, message):
    with pytest.raises(InvalidInput, match=message):
        method(**settings)
