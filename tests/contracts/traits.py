"""How far each method keeps the common contracts, and the scenes that all of them are shown.

The laws are the same for all. What a method cannot keep is written down here with the reason,
and nowhere else; a method that is not in the table fails the suite.
"""

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from reference.samples import street, yaw_pose
from scanlock.geometry.pose import Pose
from scanlock.registration.register import register

METRES, RADIANS = 0.1, math.radians(0.3)
"""How far a right pose may be from the truth.

Two scans sample a surface at other points and cut it into other polar bins, so the mean of a
part moves between them: by less than the floor of its deviation, 0.1 m, and so does the motion
that a hundred parts agree on. P2D does not end at the truth for perfect scans either: Gaussians
that overlap pull a point between them. Seen from 20 m, 0.1 m are 0.3 degrees.
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
    """What one method keeps."""

    motions: tuple[Pose, ...] = NEAR_MOTIONS
    """Motions that are found from the identity; the first is the one of the common scene."""

    identity_gap: float = 2 * METRES
    """How far points may move when a scan is registered to itself [m]."""

    is_symmetric: bool = False
    """Whether exchanging the scans inverts the pose, but for the stopping step."""

    common_gap: float = 2 * METRES
    """How far points may differ after a common motion of both scans [m]: grids stay behind."""

    half_turn_gap: float = 1e-5
    """The same after half a turn, which maps a grid with a corner at zero onto itself [m]."""

    order_gap: float = 1e-5
    """The same after a change in the order of points [m]."""

    is_local: bool = True
    """Whether a point far away in both scans changes nothing; where not, one in a single scan."""

    is_bounded: bool = True
    """Whether scans out of each other's reach end with no support, at the initial pose."""

    searches: bool = False
    """Whether an initial pose is one hypothesis among others, and none is needed."""

    uses_ground: bool = False
    """Whether a scan without anything above the ground is still something to register."""


TRAITS: dict[str, Traits] = {
    # Grids that lie a third of a cell apart along all axes turn into other grids, not each other.
    "auto": Traits(
        motions=FAR_MOTIONS, uses_ground=True, searches=True, half_turn_gap=0.5 * METRES
    ),
    # D2D is stationary at identity and symmetric under exchange, exactly.
    "sgc-ndt-d2d": Traits(motions=FAR_MOTIONS, identity_gap=1e-9, is_symmetric=True),
    "sgc-ndt-p2d": Traits(motions=FAR_MOTIONS),
    "gicp": Traits(uses_ground=True),
    "vgicp": Traits(uses_ground=True),
    # The mean and the spread of all pairs set the gate.
    "icp": Traits(uses_ground=True, is_local=False),
    # The search that looks 4 m and 25 degrees about turns with neither scan.
    "icp-annealed": Traits(uses_ground=True, is_local=False),
    # A turn of 0.8 rad is beyond the coarsest cubes of this thin scene.
    "ndt": Traits(motions=(*FAR_MOTIONS[:2], FAR_MOTIONS[3]), uses_ground=True),
    "ndt-d2d": Traits(motions=FAR_MOTIONS, identity_gap=1e-9, is_symmetric=True, uses_ground=True),
    # Seeds of k-means are drawn from the points in the order of their cubes, which turns with them.
    "mskm-ndt": Traits(
        motions=FAR_MOTIONS, half_turn_gap=2 * METRES, is_local=False, uses_ground=True
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


def gap(pose, expected, cloud):
    """How far apart two poses put the points of a cloud, at most [m]."""
    return np.linalg.norm(pose.apply(cloud) - expected.apply(cloud), axis=1).max()


def report(registration):
    """The result as plain values, less the wall times."""
    return {key: value for key, value in registration.as_dict().items() if key != "timings_s"}
