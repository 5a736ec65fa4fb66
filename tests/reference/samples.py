"""Random Gaussians, poses and scans of a known scene, the same in every run."""

import numpy as np

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.gaussians import Gaussians

SENSOR_HEIGHT = 1.7
NOISE = 0.02


def rotated_covariances(rng, variances):
    """Covariances with the given principal variances by row, along random axes."""
    rotations = [exp_rotation(rng.normal(0.0, 2.0, 3)) for _ in variances]
    axes = np.array(rotations).reshape(-1, 3, 3)
    full = np.einsum("kia,ka,kja->kij", axes, variances, axes)
    return 0.5 * (full + full.transpose(0, 2, 1))


def gaussians(rng, count, *, half_width=10.0, min_deviation=0.1, max_deviation=2.0):
    """Gaussians with log-uniform deviations and uniform means in a cube."""
    deviations = np.exp(rng.uniform(np.log(min_deviation), np.log(max_deviation), (count, 3)))
    return Gaussians.from_covariances(
        rng.uniform(-half_width, half_width, (count, 3)),
        rotated_covariances(rng, deviations**2),
        rng.integers(1, 300, count),
    )


def yaw_pose(angle, translation):
    """Rotation about z [rad] followed by a translation [m]."""
    return Pose.from_step(np.array([*translation, 0.0, 0.0, angle]))


def street(seed, count=6000, layout=42):
    """Scan from the centre of a scene of boxes, poles and flat ground.

    Each surface is sampled uniformly with noise of 2 cm, without sensor pattern or occlusion. Two
    seeds give two scans of a scene from one position; another layout gives another scene.
    """
    layout = np.random.default_rng(layout)
    rng = np.random.default_rng(seed)
    spots = layout.uniform(-30.0, 30.0, (60, 2))
    spots = spots[np.hypot(*spots.T) > 6.0]
    surfaces = [_box(rng, layout, spot, count // 28) for spot in spots[:14]]
    surfaces += [_pole(rng, spot, count // 133) for spot in spots[14:34]]
    n = count - sum(map(len, surfaces))
    radius, azimuth = 35.0 * np.sqrt(rng.random(n)), rng.uniform(0.0, 2.0 * np.pi, n)
    surfaces.append(
        np.column_stack([radius * np.cos(azimuth), radius * np.sin(azimuth), np.zeros(n)])
    )
    points = np.concatenate(surfaces) - [0.0, 0.0, SENSOR_HEIGHT]
    return points + rng.normal(0.0, NOISE, points.shape)


def _box(rng, layout, spot, count):
    width, depth = layout.uniform(0.8, 4.0, 2)
    height, heading = layout.uniform(1.5, 5.0), layout.uniform(0.0, np.pi)
    along = rng.uniform(-0.5, 0.5, count)
    side = rng.choice([-0.5, 0.5], count)
    on_long = (rng.random(count) < width / (width + depth))[:, None]
    plan = np.where(on_long, np.column_stack([along, side]), np.column_stack([side, along]))
    c, s = np.cos(heading), np.sin(heading)
    plan = plan * [width, depth] @ np.array([[c, s], [-s, c]]) + spot
    return np.column_stack([plan, rng.uniform(0.0, height, count)])


def _pole(rng, spot, count):
    azimuth = rng.uniform(0.0, 2.0 * np.pi, count)
    plan = spot + 0.12 * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
    return np.column_stack([plan, rng.uniform(0.0, 4.0, count)])
