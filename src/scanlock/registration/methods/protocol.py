"""Contract of a registration method: `prepare` each scan, then `align` a target and a source."""

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

    Raised by `Method.prepare`; `register` returns the status ``NO_CORRESPONDENCES`` instead. The
    message continues "the source": ``InsufficientData("has 3 surface points; 10 are needed")``.
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
        Clusters of a method that segments the scan, for reuse by the verification.
    features : VerificationFeatures or None
        Features of a method that verifies candidates itself, for reuse by the verification.
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
        """Add a fact to the notes of the result."""
        self.notes.append(text)

    @contextmanager
    def stage(self, name: str) -> Generator[None]:
        """Add the wall time of the ``with`` block to the stage `name`."""
        with self.clock.stage(name):
            yield


_Data = TypeVar("_Data")


class Method(Protocol[_Data]):
    """A registration method: immutable settings with `prepare` and `align`.

    Subclass it, or write a class with the same members.
    """

    __slots__ = ()

    @property
    def covariance_factor(self) -> float:
        """Ratio of the actual standard deviations of a pose to the estimated ones.

        The part of a covariance that comes from the scatter of the scene is multiplied by the
        square of the ratio. 1 for a method that was not calibrated.

        Notes
        -----
        A covariance is estimated from one pair of scans. Its scatter does not include errors that
        are common to the whole pair, such as those of the viewpoint. The built-in methods were
        calibrated on simulated pairs of streets, forests and rugged ground, 1 to 5 m apart, by
        ``python -m benchmarks.uncertainty.covariance --calibrate``: the mean normalised squared
        error is 6 for a correct covariance, and a factor is multiplied by the square root of a
        sixth of it.
        """
        return 1.0

    def prepare(self, cloud: PointCloud, log: PreparationLog | None = None) -> _Data:
        """Compute everything that depends on one scan only.

        Parameters
        ----------
        cloud : PointCloud
        log : PreparationLog, optional
            Receives notes, times and intermediate results.

        Raises
        ------
        InsufficientData
            The scan has too few points, Gaussians or surfaces.
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
            Results of `prepare`.
        start : Pose, optional
            Initial pose. Without one, methods that do not search start from the identity.
        constraints : Constraints
            Locked directions and a prior.

        Returns
        -------
        Solution
            The start with the reason ``EMPTY_OBJECTIVE`` if there are no correspondences.
        """
        ...
