"""Ground segmentation on scenes with known answers."""

import numpy as np

from scanlock.clouds.point_cloud import PointCloud
from scanlock.models.ground import GroundFinder, GroundStatus


def flat_scene(height: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of a plane `height` below the sensor with two walls, and which is plane."""
    radius = 2.0 + 38.0 * np.sqrt(rng.random(20_000))
    azimuth = rng.uniform(-np.pi, np.pi, 20_000)
    plane = np.c_[
        radius * np.cos(azimuth), radius * np.sin(azimuth), rng.normal(-height, 0.02, 20_000)
    ]
    wall = np.c_[
        rng.uniform(-10, 10, 4_000), np.full(4_000, 8.0), rng.uniform(-height, 3 - height, 4_000)
    ]
    points = np.concatenate([plane, wall, wall * [1, -1, 1]])
    return points, np.arange(len(points)) < len(plane)


def test_plane_is_ground_and_walls_are_not_at_any_sensor_height():
    points, on_plane = flat_scene(1.7, np.random.default_rng(1))
    for shift in (-30.0, 0.0, 1.5, 40.0):
        ground = GroundFinder().find(PointCloud.from_array(points + np.array([0, 0, shift])))
        assert ground.status is GroundStatus.FOUND
        assert abs(ground.sensor_height - (1.7 - shift)) < 0.05
        assert ground.is_ground[on_plane].mean() > 0.99
        above = ~on_plane & (points[:, 2] > -1.3)
        assert not ground.is_ground[above].any()
