"""Compile the kernels before time matters, by doing once what they are for."""

import math
from typing import Any, get_args

import numpy as np

from scanlock.arrays import Points
from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation
from scanlock.models.ground import GroundFinder
from scanlock.models.segmentation import Segmenter, segment
from scanlock.models.sensor_noise import SensorNoise
from scanlock.objectives.cell_scores import CellMeeting
from scanlock.registration.cluster_matching import ClusterMatcher
from scanlock.registration.icp import Icp
from scanlock.registration.methods import METHODS, Method
from scanlock.registration.ndt import Ndt
from scanlock.registration.ndt_d2d import NdtD2d
from scanlock.registration.pair_fit import PairFit
from scanlock.registration.register import register

_SENSOR_HEIGHT = 1.7
_PLANES = PairFit(step="gauss-newton", residual="point-to-plane")
_STEP = np.array([0.5, 0.2, 0.0])


def warm_up() -> None:
    """Compile every kernel of segmentation and registration, or load it from disk.

    The machine code is kept on disk, so this takes its minute once. What comes after runs at
    full speed from the first call on.
    """
    scan = _courtyard()
    tilted = scan @ exp_rotation(np.array([math.radians(12.0), 0.0, 0.0])).T
    for points in (scan, tilted):
        segment(points)
    Segmenter(ground=GroundFinder.das2013()).segment(scan)
    others: list[Method[Any]] = [
        Icp(search="delaunay", spacing=1.0),
        Icp(fit=_PLANES, noise=SensorNoise()),
        NdtD2d(meeting="cells-around", widths=(3.0,)),
        *(Ndt(meeting=meeting, widths=(3.0,)) for meeting in get_args(CellMeeting)),
    ]
    parts = METHODS["sgc-ndt-d2d"].prepare(PointCloud.from_array(scan)).gaussians[-1]
    matcher = ClusterMatcher()
    for level in (Pose.identity(), None):
        features = matcher.describe(parts, level)
        matcher.hypotheses(features, features)
    for method in (*METHODS.values(), *others):
        register(source=scan + _STEP, target=scan, method=method)


def _courtyard() -> Points:
    """Return a level ground with posts and walls on it, around a sensor: no noise, no chance."""
    radii, turns = np.meshgrid(np.linspace(2.0, 30.0, 60), np.linspace(0.0, 2.0 * np.pi, 120))
    floor = [radii * np.cos(turns), radii * np.sin(turns), np.zeros_like(radii)]
    posts = [
        np.meshgrid(x + np.linspace(0.0, 0.4, 4), y + np.linspace(0.0, 2.0, 6), _LEVELS)
        for x, y in zip(*_PLACES, strict=True)
    ]
    parts = [np.stack([np.ravel(axis) for axis in part], axis=1) for part in (floor, *posts)]
    return np.concatenate(parts) - [0.0, 0.0, _SENSOR_HEIGHT]


_LEVELS = np.linspace(0.4, 3.0, 12)
_ANGLES = np.arange(16) * 2.4
_PLACES = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)]) * np.linspace(5.0, 25.0, 16)
"""Turned by the golden angle from one to the next, so that nothing repeats."""
