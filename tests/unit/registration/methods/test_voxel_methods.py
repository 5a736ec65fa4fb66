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
from scanlock.registration.methods.mskm_ndt import MskmNdt
from scanlock.registration.methods.ndt import Ndt
from scanlock.registration.methods.ndt_d2d import NdtD2d
from scanlock.registration.methods.scales import dense_scales
from scanlock.registration.methods.voxel_scan import VoxelScan, measured_points

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
    stays, moves = (
        method.prepare(PointCloud.from_array(scan))
        for scan in (street(1), motion.inverse().apply(street(2)))
    )
    return method.align(stays, moves, start or Pose.identity(), constraints or Constraints())


@pytest.mark.parametrize("name", _DEFAULTS | _VARIANTS)
def test_a_near_motion_is_found(name):
    found = _align((_DEFAULTS | _VARIANTS)[name], _NEAR)
    assert found.reason.is_converged
    assert found.pose.is_close(_NEAR, translation=0.1, rotation=0.005)


@pytest.mark.parametrize("name", [*_DEFAULTS, "own", "all", "cells", "k-means damped"])
def test_coarse_to_fine_finds_a_far_motion(name):
    found = _align((_DEFAULTS | _VARIANTS)[name], _FAR)
    assert found.reason.is_converged
    assert found.pose.is_close(_FAR, translation=0.1, rotation=0.005)


@pytest.mark.parametrize("name", _PUBLISHED)
def test_published_settings_work_from_near_and_not_from_far(name):
    assert _align(_PUBLISHED[name], _NEAR).pose.is_close(_NEAR, translation=0.15, rotation=0.01)
    far = yaw_pose(1.2, (9.0, 6.0, 0.0))
    assert not _align(_PUBLISHED[name], far).pose.is_close(far, translation=0.3, rotation=0.02)


@pytest.mark.parametrize("name", _DEFAULTS)
def test_a_restraint_holds_at_every_scale(name):
    start = Pose.from_step(np.array([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]))
    found = _align(_DEFAULTS[name], _NEAR, start, Constraints(dof="xy+yaw"))
    for entry in found.history:
        np.testing.assert_allclose(entry.pose.translation[2], 0.1, atol=1e-12)
        np.testing.assert_allclose(entry.pose.rotation[2], [0.0, 0.0, 1.0], atol=1e-12)
    assert np.linalg.norm(found.pose.translation[:2] - _NEAR.translation[:2]) < 0.1


@pytest.mark.parametrize("name", _DEFAULTS)
def test_scans_out_of_reach_give_the_start_back(name):
    start = yaw_pose(0.1, (500.0, 0.0, 0.0))
    found = _align(_DEFAULTS[name], _NEAR, start)
    assert found.reason is StopReason.EMPTY_OBJECTIVE
    assert found.pose == start


@pytest.mark.parametrize("name", _DEFAULTS | _PUBLISHED)
def test_too_few_points_are_a_shortage_and_not_an_error(name):
    method = (_DEFAULTS | _PUBLISHED)[name]
    for scan in (np.ones((1, 3)), np.full((500, 3), 2.5), np.zeros((50, 3))):
        kept = method.prepare(PointCloud.from_array(scan))
        assert "needed" in kept.insufficient
    enough = method.prepare(PointCloud.from_array(street(1)))
    assert enough.insufficient == ""
    assert "Gaussians" in enough.notes[0]
    assert sum(enough.timings.values()) > 0.0


@pytest.mark.parametrize("method", [Ndt, NdtD2d])
def test_widths_at_which_a_scan_starves_are_passed_over(method):
    # Of 6000 points half lie in cells of 1 m with six or more, and next to none in smaller ones.
    fine = method(widths=(8.0, 4.0, 2.0, 1.0, 0.1))
    kept = fine.prepare(PointCloud.from_array(street(1)))
    assert kept.shares[3] < 0.6 < kept.shares[2]
    assert _align(fine, _NEAR).pose == _align(method(widths=(8.0, 4.0, 2.0)), _NEAR).pose


def test_a_scan_that_starves_at_every_width_is_registered_by_most_gaussians():
    kept = Ndt(cell_sizes=(1.0, 0.5)).prepare(PointCloud.from_array(street(1)))
    assert max(kept.shares) < 0.6
    assert dense_scales(kept) == dense_scales(kept, kept) == [0]


def test_points_that_say_no_return_are_left_out_of_a_sensor_frame_only():
    scan = street(1)
    spoilt = np.insert(scan, [0, 700], 0.0, axis=0)
    np.testing.assert_array_equal(measured_points(PointCloud.from_array(spoilt)), scan)
    mapped = PointCloud.from_array(scan + 5000.0)
    assert len(measured_points(mapped)) == len(scan)


def test_p2d_takes_all_points_or_thins_them():
    cloud = PointCloud.from_array(street(1))
    assert len(Ndt(voxel_size=0.0).prepare(cloud).points) == len(cloud)
    assert 4 < len(Ndt(voxel_size=10.0).prepare(cloud).points) < 0.1 * len(cloud)


def test_identical_scans_are_stationary_for_d2d():
    kept = NdtD2d().prepare(PointCloud.from_array(street(1)))
    found = NdtD2d().align(kept, kept, Pose.identity())
    assert found.pose.is_close(Pose.identity(), translation=1e-9, rotation=1e-9)


def test_the_settings_of_the_papers():
    das, stoyanov = _PUBLISHED["das2013"], _PUBLISHED["stoyanov2012"]
    assert (das.widths, das.meeting, das.spacing) == ((3.0,), "own-cell", 0.0)
    assert das.solver.criteria.gradient_tolerance == das.solver.criteria.step_tolerance == 1e-6
    assert stoyanov.widths == (2.0, 1.0, 0.5)
    assert stoyanov.shape == ScoreShape(sharpness=0.05)


@pytest.mark.parametrize("method", [*_DEFAULTS.values(), *_PUBLISHED.values()])
def test_settings_and_what_is_kept_survive_a_pickle(method):
    assert pickle.loads(pickle.dumps(method)) == method
    assert hash(method) == hash(pickle.loads(pickle.dumps(method)))
    kept = pickle.loads(pickle.dumps(method.prepare(PointCloud.from_array(street(1)))))
    assert isinstance(kept, VoxelScan) or kept.gaussians
    assert kept.insufficient == ""


@pytest.mark.parametrize(
    ("method", "settings", "message"),
    [
        (Ndt, {"widths": ()}, "widths must not grow"),
        (Ndt, {"widths": (1.0, 2.0)}, "widths must not grow from scale to scale"),
        (NdtD2d, {"widths": (1.0, 0.0)}, r"widths must be positive, got 0\.0 m"),
        (Ndt, {"meeting": "nearest"}, "meeting must be one of own-cell, .*, all, got 'nearest'"),
        (Ndt, {"outlier_ratio": 1.0}, "outlier_ratio must lie above 0"),
        (Ndt, {"spacing": -1.0}, "spacing must be at least 0"),
        (Ndt, {"loose_step": 2.0}, "loose_step must lie between"),
        (NdtD2d, {"meeting": "own-cell"}, "meeting must be one of nearest, cells-around, all"),
        (NdtD2d, {"cells_around": -1}, "cells_around must be a whole number"),
        (NdtD2d, {"weight_power": -1.0}, "weight_power must be at least 0"),
        (MskmNdt, {"score": "points"}, "score must be 'p2d' or 'd2d', got 'points'"),
        (MskmNdt, {"points": "ground"}, "points must be 'obstacles' or 'all', got 'ground'"),
        (MskmNdt, {"counts": (200, 100)}, "counts must not fall from scale to scale"),
        (MskmNdt, {"counts": ()}, "counts must not fall"),
        (MskmNdt, {"counts": (0, 5)}, "counts must be a whole number of at least 1"),
        (MskmNdt, {"spacing": 0.0}, "spacing must be positive"),
        (MskmNdt, {"least_count": 1}, "least_count must be"),
        (MskmNdt, {"deviation_floor": 0.0}, "deviation_floor must be positive"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(method, settings, message):
    with pytest.raises(InvalidInput, match=message):
        method(**settings)
