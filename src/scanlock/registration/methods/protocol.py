"""The contract of a registration method: `prepare` each scan, `align` two of them."""

from collections.abc import Generator
from contextlib import contextmanager
from typing import Protocol, TypeVar

from scanlock.clouds.point_cloud import PointCloud
from scanlock.errors import ScanlockError
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.features import VerificationFeatures
from scanlock.segmentation.cluster_gaussians import ClusterGaussians
from scanlock.timing import StageClock


class InsufficientData(ScanlockError):
    """A scan has too few points, Gaussians or surfaces for a method.

    Raised by `Method.prepare`. `register` returns it as the status ``NO_CORRESPONDENCES``.
    The message follows "the source": ``InsufficientData("has 3 surface points; 10 are needed")``.
    """


class PreparationLog:
    """Notes, times and intermediate results of the preparation of one scan.

    Attributes
    ----------
    notes : list of str
        Facts for the notes of the result.
    seconds : dict of str to float [s]
        Wall time of each stage.
    clusters : ClusterGaussians or None
        Set by methods that segment the scan, so that the verification need not segment it again.
    features : VerificationFeatures or None
        Set by methods that verify candidates themselves.
    """

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.clock = StageClock()
        self.clusters: ClusterGaussians | None = None
        self.features: VerificationFeatures | None = None

    @property
    def seconds(self) -> dict[str, float]:
        """Wall time of each stage [s]."""
        return self.clock.seconds

    def note(self, text: str) -> None:
        """Keep a fact for the notes of the result."""
        self.notes.append(text)

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Add the wall time of the ``with`` block to the stage `name`."""
        with self.clock.stage(name):
            yield


_Data = TypeVar("_Data")


class Method(Protocol[_Data]):
    """A registration method: settings with `prepare` and `align`.

    Subclass it, or write a class with the same members.
    """

    __slots__ = ()

    @property
    def covariance_factor(self) -> float:
        """Ratio of the actual standard deviations of a pose to those estimated within a pair."""
        return 1.0

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> _Data:
        """Compute everything that depends on one scan only.

        Parameters
        ----------
        cloud : PointCloud
        log : PreparationLog, optional
            Takes notes, times and intermediate results.

        Raises
        ------
        InsufficientData
            The scan has too little to be registered.
        """
        ...

    def align(
        self,
        target: _Data,
        source: _Data,
        start: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> Solution:
        """Estimate the pose, target from source, in the local frames of the clouds.

        Parameters
        ----------
        target, source
            From `prepare`.
        start : Pose, optional
            The initial pose. None if there is none: methods without a search of their own then
            start from the identity.
        constraints : Constraints
        """
        ...
