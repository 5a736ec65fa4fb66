"""Sparse clouds: registered in units of their length scale, with a result in metres."""

import math
import re

import numpy as np
import pytest

from reference.samples import street, yaw_pose
from scanlock.clouds.point_tree import PointTree
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import PosePrior
from scanlock.registration.assess import assess
from scanlock.registration.methods import sparse_refinement
from scanlock.registration.methods.auto.auto import Auto
from scanlock.registration.methods.gicp import Gicp
from scanlock.registration.methods.icp.distance_rejection import AdaptiveRejection
from scanlock.registration.prepare import prepare
from scanlock.registration.register import register
from scanlock.registration.verification.status import Status

_FACTOR = 4.0

_MOTION = yaw_pose(0.2, (6.0, -4.0, 0.4))


@pytest.fixture(scope="module")
def target():
    return _FACTOR * street(1)


@pytest.fixture(scope="module")
def source():
    return _MOTION.inverse().apply(_FACTOR * street(2))


@pytest.fixture(scope="module")
def found(source, target):
    return register(source=source, target=target, covariance=True)


def test_a_sparse_pair_is_solved_without_a_start(found):
    assert found.length_scale > 2.0
    assert found.ok
    assert found.target_from_source.is_close(
        _MOTION, translation=0.1 * _FACTOR, rotation=math.radians(0.3)
    )
    assert any("all lengths of the settings are multiplied by" in note for note in found.notes)


def test_lengths_of_the_result_are_metres(found, source, target):
    # A pair of coordinates divided by the length scale is dense, and has the same result but for
    # the settings of fine NDT that depend on the density.
    scale = found.length_scale
    start = Pose(_MOTION.rotation, _MOTION.translation / scale)
    kwargs = {"method": "gicp", "covariance": "hessian"}
    sparse = register(source=source, target=target, initial=_MOTION, **kwargs)
    dense = register(source=source / scale, target=target / scale, initial=start, **kwargs)
    if dense.length_scale != 1.0:
        pytest.fail(f"the divided pair must be dense, got {dense.length_scale}")
    np.testing.assert_allclose(
        sparse.target_from_source.translation,
        scale * dense.target_from_source.translation,
        atol=1e-6,
    )
    for name in ("inlier_rmse", "roughness", "refinement_shift"):
        ratio = getattr(sparse.metrics, name) / getattr(dense.metrics, name)
        assert ratio == pytest.approx(scale, rel=1e-3)
    assert sparse.probability == pytest.approx(dense.probability, abs=1e-4)
    assert sparse.status is dense.status
    factors = np.repeat([scale, 1.0], 3)
    np.testing.assert_allclose(
        sparse.covariance.matrix, dense.covariance.matrix * np.outer(factors, factors), rtol=1e-3,
        atol=1e-12,
    )  # fmt: skip
    np.testing.assert_allclose(
        sparse.hessian * np.outer(factors, factors), dense.hessian, rtol=1e-3, atol=1e-6
    )
    for one, other in zip(sparse.directions, dense.directions, strict=True):
        factor = scale if one.kind == "translation" else 1.0
        assert one.deviation == pytest.approx(factor * other.deviation, rel=1e-3)
    for one, other in zip(sparse.history, dense.history, strict=True):
        np.testing.assert_allclose(one.pose.translation, scale * other.pose.translation, atol=1e-6)


def test_lengths_of_notes_are_metres(source, target):
    method = Gicp(rejection=AdaptiveRejection())
    sparse = register(source=source, target=target, initial=_MOTION, method=method)
    scale = sparse.length_scale
    start = Pose(_MOTION.rotation, _MOTION.translation / scale)
    dense = register(source=source / scale, target=target / scale, initial=start, method=method)
    assert (scale > 2.0, dense.length_scale) == (True, 1.0)
    lengths = [
        float(re.search(r"distance D = (\S+) m, ", "\n".join(result.notes))[1])
        for result in (sparse, dense)
    ]
    # Three digits are printed.
    assert lengths[0] == pytest.approx(scale * lengths[1], rel=1e-2)


def test_a_prior_in_metres_is_kept(source, target):
    mean = yaw_pose(0.2, (7.0, -4.0, 0.4))
    prior = PosePrior.from_deviations(mean, 1e-3, 1e-4)
    result = register(source=source, target=target, method="gicp", initial=mean, prior=prior)
    assert result.target_from_source.is_close(mean, translation=0.05, rotation=1e-3)


def test_a_pair_takes_the_larger_length_scale(target):
    dense = street(3)
    ready = prepare(dense)
    assert ready.length_scale == 1.0
    result = register(source=ready, target=target)
    assert result.length_scale == prepare(target).length_scale > 1.0


def test_prepared_scans_give_the_result_of_the_scans(found, source, target):
    again = register(source=prepare(source), target=prepare(target))
    assert again.target_from_source == found.target_from_source
    assert again.probability == found.probability


@pytest.mark.parametrize(
    "error",
    [
        (6.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, -9.0, 0.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 6.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.0, 0.0, 0.1),
        (0.0, 0.0, 0.0, 0.0, 0.0, math.pi),
    ],
)
def test_wrong_poses_of_sparse_clouds_are_not_ok(source, target, error):
    wrong = Pose.from_step(np.array(error)) @ _MOTION
    result = assess(source=source, target=target, pose=wrong)
    assert result.status is not Status.OK
    assert result.probability < 0.5


def test_another_place_is_not_ok(target):
    elsewhere = _FACTOR * street(5, layout=7)
    result = register(source=elsewhere, target=target)
    assert result.status is not Status.OK


def test_auto_refines_a_sparse_pair_to_a_tenth_of_its_spacing(found, source, target):
    spacing = np.median(PointTree.from_points(target).nearest(source)[1])
    difference = found.target_from_source.apply(source) - _MOTION.apply(source)
    assert math.sqrt((difference**2).sum(axis=1).mean()) < 0.1 * spacing


def test_the_covariance_has_the_factor_of_the_refinement(found, source, target, monkeypatch):
    factor = sparse_refinement._COVARIANCE_FACTOR
    monkeypatch.setattr(sparse_refinement, "_COVARIANCE_FACTOR", 10.0 * factor)
    wide = register(source=source, target=target).covariance.deviations
    # The minimum covariance has no factor.
    np.testing.assert_allclose(wide, 10.0 * found.covariance.deviations, rtol=0.1)


def test_auto_without_the_refinement_keeps_the_pose_of_the_cells(found, source, target):
    of_cells = register(source=source, target=target, method=Auto(sparse_refinement=None))
    assert of_cells.ok
    assert of_cells.target_from_source != found.target_from_source
    assert of_cells.target_from_source.is_close(
        found.target_from_source, translation=0.02 * _FACTOR, rotation=1e-3
    )


def test_dense_scans_are_not_refined_by_planes():
    target, source = street(1), street(2)
    first = register(source=source, target=target)
    again = register(source=source, target=target, method=Auto(sparse_refinement=None))
    assert first.target_from_source == again.target_from_source
