import numpy as np

from scanlock.simulation.scenes.site import Site, car_pose, upright_pose


def test_a_claim_succeeds_once_and_only_on_free_ground():
    site = Site(np.array([-20.0, -20.0]), np.array([20.0, 20.0]))
    assert site.claim(np.array([0.0, 0.0]), 0.7, 8.0, 4.0)
    assert not site.claim(np.array([0.0, 0.0]), 0.0, 1.0, 1.0)
    assert not site.claim(np.array([3.0 * np.cos(0.7), 3.0 * np.sin(0.7)]), 0.0, 0.5, 0.5)
    # There is room beside its narrow side, but not with a margin.
    aside = 4.0 * np.array([-np.sin(0.7), np.cos(0.7)])
    assert not site.claim(aside, 0.7, 2.0, 2.0, margin=2.0)
    assert site.claim(aside, 0.7, 2.0, 2.0)
    assert not site.claim(np.array([19.9, 0.0]), 0.0, 2.0, 2.0)


def test_blocked_cells_are_occupied():
    site = Site(np.zeros(2), np.array([10.0, 10.0]))
    site.block(site.cells()[:, 0] < 5.0)
    assert not site.claim(np.array([3.0, 5.0]), 0.0, 1.0, 1.0)
    assert site.claim(np.array([8.0, 5.0]), 0.0, 1.0, 1.0)


def test_objects_are_upright_and_cars_have_both_axles_on_the_ground():
    pose = upright_pose(np.array([1.0, 2.0, 3.0]), np.pi / 2)
    np.testing.assert_allclose(pose.apply(np.array([1.0, 0, 1])), [1, 3, 4], atol=1e-12)
    car = car_pose(lambda xy: 0.1 * xy[:, 1], np.array([5.0, 6.0]), np.pi / 2)
    axles = car.apply(np.array([[1.3, 0.0, 0], [-1.3, 0, 0]]))
    np.testing.assert_allclose(axles[:, 2], 0.1 * axles[:, 1], atol=1e-12)
