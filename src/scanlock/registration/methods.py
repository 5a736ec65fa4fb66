"""The one list of methods; the command line, the studies and the contract tests read it."""

from typing import Protocol

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.registration.landmarks import Landmarks
from scanlock.registration.sgc_ndt import SgcNdt
from scanlock.solvers.solution import Solution


class Method(Protocol):
    """A way to register two scans: settings that can do their job."""

    def prepare(self, cloud: PointCloud) -> Landmarks:
        """Return what the method keeps of a scan, to be used as target or source."""
        ...

    def align(self, target: Landmarks, source: Landmarks, start: Pose) -> Solution:
        """Return the pose found from `start`, in the local frames of the clouds."""
        ...


METHODS: dict[str, Method] = {
    "sgc-ndt-d2d": SgcNdt(score="d2d"),
    "sgc-ndt-p2d": SgcNdt(score="p2d"),
}
"""Each method by name, with its default settings."""

DEFAULT_METHOD = "sgc-ndt-d2d"
