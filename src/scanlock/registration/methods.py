"""The one list of methods; the command line, the studies and the contract tests read it."""

from collections.abc import Mapping
from typing import Any, Protocol, TypeVar, runtime_checkable

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.objectives.restraint import FREE, Restraint
from scanlock.registration.annealing import AnnealedStart
from scanlock.registration.auto import Auto, Found
from scanlock.registration.gicp import Gicp
from scanlock.registration.icp import Icp
from scanlock.registration.mskm_ndt import MskmNdt
from scanlock.registration.ndt import Ndt
from scanlock.registration.ndt_d2d import NdtD2d
from scanlock.registration.sgc_ndt import SgcNdt
from scanlock.solvers.solution import Solution


class Kept(Protocol):
    """What a method keeps of a scan, as target or as source."""

    @property
    def cloud(self) -> PointCloud:
        """The checked points of the whole scan."""
        ...

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found on the way that a user may want to know."""
        ...

    @property
    def timings(self) -> Mapping[str, float]:
        """Wall time of each stage [s]."""
        ...

    @property
    def shortage(self) -> str:
        """Why the scan cannot be registered, to follow "the source"; empty when it can."""
        ...


_Kept = TypeVar("_Kept", bound=Kept)


class Method(Protocol[_Kept]):
    """A way to register two scans: settings that can do their job."""

    def prepare(self, cloud: PointCloud) -> _Kept:
        """Return what the method keeps of a scan."""
        ...

    def align(
        self, target: _Kept, source: _Kept, start: Pose, restraint: Restraint = FREE
    ) -> Solution:
        """Return the pose found from `start`, in the local frames of the clouds."""
        ...


@runtime_checkable
class Search(Protocol):
    """A method that needs no start."""

    def find(
        self, target: Any, source: Any, initial: Pose | None = None, restraint: Restraint = FREE
    ) -> Found:
        """Return the pose found and its rivals, in the local frames of the clouds."""
        ...


METHODS: dict[str, Method[Any]] = {
    "auto": Auto(),
    "sgc-ndt-d2d": SgcNdt(score="d2d"),
    "sgc-ndt-p2d": SgcNdt(score="p2d"),
    "gicp": Gicp(),
    "vgicp": Gicp(meeting="voxel"),
    "icp": Icp(),
    "icp-annealed": Icp(annealing=AnnealedStart()),
    "ndt": Ndt(),
    "ndt-d2d": NdtD2d(),
    "mskm-ndt": MskmNdt(),
}
"""Each method by name, with its default settings."""

DEFAULT_METHOD = "auto"
