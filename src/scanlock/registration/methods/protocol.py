"""What a registration method is, what it keeps of a scan, and what a search ends with."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar, runtime_checkable

from scanlock.clouds.point_cloud import PointCloud
from scanlock.geometry.pose import Pose
from scanlock.optimisation.objectives.constraints import UNCONSTRAINED, Constraints
from scanlock.optimisation.solvers.solution import Solution
from scanlock.registration.verification.candidate import Candidate


@dataclass(frozen=True, slots=True, eq=False)
class SearchResult:
    """What a search ended with.

    Attributes
    ----------
    solution : Solution
        The pose chosen, with the history of all descents.
    candidates : tuple of Candidate
        All finished poses, the chosen one first.
    rival : float
        How well the second stands as a share of the first, by what the choice was made by; NaN
        where nothing was chosen from.
    """

    solution: Solution
    candidates: tuple[Candidate, ...]
    rival: float = math.nan


class Prepared(Protocol):
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
    def insufficient(self) -> str:
        """Why the scan cannot be registered, to follow "the source"; empty when it can."""
        ...


_Kept = TypeVar("_Kept", bound=Prepared)


class Method(Protocol[_Kept]):
    """A way to register two scans: settings that can do their job."""

    def prepare(self, cloud: PointCloud) -> _Kept:
        """Return what the method keeps of a scan."""
        ...

    def align(
        self, target: _Kept, source: _Kept, start: Pose, constraints: Constraints = UNCONSTRAINED
    ) -> Solution:
        """Return the pose found from `start`, in the local frames of the clouds."""
        ...


@runtime_checkable
class Search(Protocol):
    """A method that needs no start."""

    def find(
        self,
        target: Any,
        source: Any,
        initial: Pose | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> SearchResult:
        """Return the pose found and its rivals, in the local frames of the clouds."""
        ...
