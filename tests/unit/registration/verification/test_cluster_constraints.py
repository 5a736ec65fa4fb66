import numpy as np
import pytest

from scanlock.geometry.pose import Pose
from scanlock.models.gaussians import Gaussians
from scanlock.registration.verification.cluster_constraints import (
    ClusterConstraints,
    cluster_constraints,
)


def _all_alike(means, covariance):
    count = len(means)
    return Gaussians.from_covariances(
        np.array(means, float), np.tile(covariance, (count, 1, 1)), np.full(count, 50)
    )


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_thin_sides_of_parts_hold_across_and_slide_along(turn):
    # Plates of 1 m that are 0.01 m thin: along x and z each axis is the longest.
    pose = Pose.from_step(np.array([3.0, -2.0, 1.0, 0.0, 0.0, turn]))
    plates = _all_alike(np.zeros((5, 3)), np.diag([1.0, 1e-4, 1.0])).transformed(pose)
    shares = cluster_constraints(plates).shares("translation", pose.rotation, np.zeros(3))
    np.testing.assert_allclose(shares, [0.0, 1.0, 0.0], atol=1e-12)
    # Poles, thin along x and y, hold what the plates let slide; height stays free.
    poles = _all_alike(np.zeros((5, 3)), np.diag([1e-4, 1e-4, 1.0])).transformed(pose)
    both = cluster_constraints(Gaussians.joined([plates, poles]))
    shares = both.shares("translation", pose.rotation, np.zeros(3))
    np.testing.assert_allclose(shares, [0.5, 1.0, 0.0], atol=1e-12)


def test_the_cut_side_of_a_plate_holds_little():
    # Half as wide as high: that is how it was cut, not an edge of the thing.
    plates = _all_alike(np.zeros((5, 3)), np.diag([0.25, 1e-4, 1.0]))
    shares = cluster_constraints(plates).shares("translation", np.eye(3), np.zeros(3))
    np.testing.assert_allclose(shares, [0.75**4, 1.0, 0.0], atol=1e-3)


def test_poles_hold_a_heading_and_one_pole_does_not():
    place = np.array([2.0, 1.0, 0.0])
    ring = [(5.0, 0.0, 0.0), (-5.0, 1.0, 0.0), (0.0, 6.0, 0.0), (1.0, -4.0, 0.0)]
    poles = cluster_constraints(_all_alike(ring, np.diag([1e-4, 1e-4, 1.0])))
    assert poles.shares("rotation", np.eye(3), place)[2] == pytest.approx(1.0, abs=1e-3)
    one = cluster_constraints(_all_alike(ring[:1], np.diag([1e-4, 1e-4, 1.0])))
    assert one.shares("rotation", np.eye(3), place)[2] == pytest.approx(0.0, abs=1e-9)


def test_a_round_wall_does_not_hold_the_turn_about_its_axis():
    angles = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    plate = _all_alike([(8.0, 0.0, 0.0)], np.diag([1e-4, 1.0, 1.0]))
    wall = Gaussians.joined(
        [plate.transformed(Pose.from_step(np.array([0, 0, 0, 0, 0, a]))) for a in angles]
    )
    held = cluster_constraints(wall)
    assert held.shares("rotation", np.eye(3), np.zeros(3))[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(
        held.shares("translation", np.eye(3), np.zeros(3)), [1.0, 1.0, 0.0], atol=1e-9
    )


def test_rotations_are_about_the_origin_asked_for_and_shares_do_not_see_the_frame():
    rng = np.random.default_rng(0)
    parts = Gaussians.from_covariances(
        rng.uniform(-9.0, 9.0, (30, 3)),
        np.array([np.diag(d) for d in rng.uniform(0.01, 1.0, (30, 3))]),
        rng.integers(10, 90, 30),
    )
    pose = Pose.from_step(np.array([30.0, -20.0, 4.0, 0.3, 0.2, 1.1]))
    origin = np.array([1.0, 2.0, 3.0])
    for kind in ("translation", "rotation"):
        here = cluster_constraints(parts).shares(kind, np.eye(3), origin)
        there = cluster_constraints(parts.transformed(pose)).shares(
            kind, pose.rotation, pose.apply(origin[None])[0]
        )
        np.testing.assert_allclose(here, there, rtol=1e-6)


def test_round_parts_hold_every_way():
    some = _all_alike(np.arange(12.0).reshape(4, 3), np.eye(3))
    held = cluster_constraints(some)
    np.testing.assert_allclose(held.shares("translation", np.eye(3), np.zeros(3)), 1.0, rtol=1e-12)


def test_no_parts_hold_nothing():
    assert not ClusterConstraints.none().shares("rotation", np.eye(3), np.ones(3)).any()
