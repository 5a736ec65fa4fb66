import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.cluster_constraints import (
    ClusterConstraints,
    cluster_constraints,
)


def _equal_gaussians(means, covariance):
    count = len(means)
    return Gaussians.from_covariances(
        np.array(means, float), np.tile(covariance, (count, 1, 1)), np.full(count, 50)
    )


@pytest.mark.parametrize("yaw", [0.0, 0.7])
def test_thin_axes_constrain_translations_and_long_axes_do_not(yaw):
    # Plates of 1 m that are 0.01 m thin: along x and z each axis is the longest.
    pose = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.0, 0.0, yaw]))
    plates = _equal_gaussians(np.zeros((5, 3)), np.diag([1.0, 1e-4, 1.0])).transformed(pose)
    ratios = cluster_constraints(plates).ratios("translation", pose.rotation, np.zeros(3))
    np.testing.assert_allclose(ratios, [0.0, 1.0, 0.0], atol=1e-12)
    # Poles, thin along x and y, constrain x, which plates do not; z stays unconstrained.
    poles = _equal_gaussians(np.zeros((5, 3)), np.diag([1e-4, 1e-4, 1.0])).transformed(pose)
    both = cluster_constraints(Gaussians.joined([plates, poles]))
    ratios = both.ratios("translation", pose.rotation, np.zeros(3))
    np.testing.assert_allclose(ratios, [0.5, 1.0, 0.0], atol=1e-12)


def test_the_cut_side_of_a_plate_constrains_little():
    # Half as wide as high: the cluster was cut there.
    plates = _equal_gaussians(np.zeros((5, 3)), np.diag([0.25, 1e-4, 1.0]))
    ratios = cluster_constraints(plates).ratios("translation", np.eye(3), np.zeros(3))
    np.testing.assert_allclose(ratios, [0.75**4, 1.0, 0.0], atol=1e-3)


def test_poles_constrain_yaw_and_one_pole_does_not():
    origin = np.array([2.0, 1.0, 0.0])
    ring = [(5.0, 0.0, 0.0), (-5.0, 1.0, 0.0), (0.0, 6.0, 0.0), (1.0, -4.0, 0.0)]
    poles = cluster_constraints(_equal_gaussians(ring, np.diag([1e-4, 1e-4, 1.0])))
    assert poles.ratios("rotation", np.eye(3), origin)[2] == pytest.approx(1.0, abs=1e-3)
    one = cluster_constraints(_equal_gaussians(ring[:1], np.diag([1e-4, 1e-4, 1.0])))
    assert one.ratios("rotation", np.eye(3), origin)[2] == pytest.approx(0.0, abs=1e-9)


def test_a_round_wall_does_not_constrain_rotations_about_its_axis():
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    plate = _equal_gaussians([(8.0, 0.0, 0.0)], np.diag([1e-4, 1.0, 1.0]))
    wall = Gaussians.joined(
        [plate.transformed(Pose.from_step(np.array([0, 0, 0, 0, 0, a]))) for a in angles]
    )
    constraints = cluster_constraints(wall)
    rotations = constraints.ratios("rotation", np.eye(3), np.zeros(3))
    assert rotations[2] == pytest.approx(0.0, abs=1e-9)
    translations = constraints.ratios("translation", np.eye(3), np.zeros(3))
    np.testing.assert_allclose(translations, [1.0, 1.0, 0.0], atol=1e-9)


def test_ratios_do_not_depend_on_the_frame():
    rng = np.random.default_rng(0)
    gaussians = Gaussians.from_covariances(
        rng.uniform(-9.0, 9.0, (30, 3)),
        np.array([np.diag(d) for d in rng.uniform(0.01, 1.0, (30, 3))]),
        rng.integers(10, 90, 30),
    )
    pose = Pose.from_step(np.array([30.0, -20.0, 4.0, 0.3, 0.2, 1.1]))
    origin = np.array([1.0, 2.0, 3.0])
    for kind in ("translation", "rotation"):
        expected = cluster_constraints(gaussians).ratios(kind, np.eye(3), origin)
        found = cluster_constraints(gaussians.transformed(pose)).ratios(
            kind, pose.rotation, pose.apply(origin[None])[0]
        )
        np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_round_gaussians_constrain_all_directions():
    spheres = _equal_gaussians(np.arange(12.0).reshape(4, 3), np.eye(3))
    ratios = cluster_constraints(spheres).ratios("translation", np.eye(3), np.zeros(3))
    np.testing.assert_allclose(ratios, 1.0, rtol=1e-12)


def test_a_scan_without_clusters_constrains_nothing():
    assert not ClusterConstraints.unconstrained().ratios("rotation", np.eye(3), np.ones(3)).any()
