"""Tolerances of each method in the contract tests, and the scenes of these tests.

The contracts are the same for all methods. Every exception is in this table, with its reason; a
method that is not in the table fails the suite.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register

METRES, RADIANS = 0.1, math.radians(0.3)
"""Maximum errors of a correct pose.

Two scans sample a surface at different points and divide it into different polar bins, so the
mean of a cluster differs by up to the minimum deviation, 0.1 m; the estimated motion differs by
less. P2D has a bias even for perfect scans, because overlapping Gaussians attract the same point.
At a range of 20 m, 0.1 m are 0.3 degrees.
"""

FAR = yaw_pose(0.2, (2.0, -1.0, 0.1))
NEAR = yaw_pose(0.02, (0.3, -0.2, 0.05))

FAR_MOTIONS = (
    FAR,
    yaw_pose(-0.5, (4.0, 3.0, -0.2)),
    yaw_pose(0.8, (-5.0, 2.0, 0.0)),
    yaw_pose(0.0, (8.0, 0.0, 0.0)),
)
NEAR_MOTIONS = (NEAR, yaw_pose(-0.03, (-0.2, 0.4, 0.0)), yaw_pose(0.05, (0.0, 0.0, 0.1)))


@dataclass(frozen=True, kw_only=True, slots=True)
class Traits:
    """Tolerances and properties of one method."""

    motions: tuple[Pose, ...] = NEAR_MOTIONS
    """Motions recovered from the identity; the first is that of the common scene."""

    identity_tolerance: float = 2 * METRES
    """Maximum point distance when a scan is registered to itself [m]."""

    is_symmetric: bool = False
    """Whether exchanging the scans inverts the pose within the step tolerance."""

    common_motion_tolerance: float = 2 * METRES
    """Maximum point distance after a common motion of both scans, but not of the grids [m]."""

    half_turn_tolerance: float = 1e-5
    """Maximum point distance after half a turn, which maps a grid with a corner at zero onto
    itself [m]."""

    order_tolerance: float = 1e-5
    """Maximum point distance after a change in the order of points [m]."""

    is_local: bool = True
    """Whether a distant point in both scans has no effect; if not, the source alone has one."""

    is_bounded: bool = True
    """Whether scans without overlap give no correspondences and the initial pose."""

    searches: bool = False
    """Whether the method searches globally, with an initial pose as one of its hypotheses."""

    uses_ground: bool = False
    """Whether a scan of bare ground can be registered."""


TRAITS: dict[str, Traits] = {
    # Half a turn does not map grids offset by a third of a cell onto each other.
    "auto": Traits(
        motions=FAR_MOTIONS, uses_ground=True, searches=True, half_turn_tolerance=0.5 * METRES
    ),
    # D2D is exactly stationary at the identity, and symmetric under exchange of the scans.
    "sgc-ndt-d2d": Traits(motions=FAR_MOTIONS, identity_tolerance=1e-9, is_symmetric=True),
    "sgc-ndt-p2d": Traits(motions=FAR_MOTIONS),
    "gicp": Traits(uses_ground=True),
    "vgicp": Traits(uses_ground=True),
    # The threshold depends on the mean and deviation of all correspondence distances.
    "icp": Traits(uses_ground=True, is_local=False),
    # The annealed starts, within 4 m and 25 degrees, do not rotate with the scans.
    "icp-annealed": Traits(uses_ground=True, is_local=False),
    # A rotation of 0.8 rad is outside the basin of the coarsest cells in this sparse scene.
    "ndt": Traits(motions=(*FAR_MOTIONS[:2], FAR_MOTIONS[3]), uses_ground=True),
    "ndt-d2d": Traits(
        motions=FAR_MOTIONS, identity_tolerance=1e-9, is_symmetric=True, uses_ground=True
    ),
    # Seeds of k-means depend on the order of the voxels, which changes with a rotation.
    "mskm-ndt": Traits(
        motions=FAR_MOTIONS, half_turn_tolerance=2 * METRES, is_local=False, uses_ground=True
    ),
}


def motion(method):
    return TRAITS[method].motions[0]


@cache
def target():
    return street(1)


@cache
def _source(pose):
    return pose.inverse().apply(street(2))


def source(method):
    return _source(motion(method))


@cache
def result(method):
    return register(source=source(method), target=target(), method=method)


def max_point_distance(pose, expected, cloud):
    """Largest distance between the points of a cloud transformed by two poses [m]."""
    return np.linalg.norm(pose.apply(cloud) - expected.apply(cloud), axis=1).max()


def report(registration):
    """The result as plain values, without the run times."""
    return {key: value for key, value in registration.as_dict().items() if key != "timings_s"}
