"""Data classes of an experiment: methods, registrations, claims, and sections of its page."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Vector
from scanlock.experiments.series import ScanSeries
from scanlock.geometry.pose import Pose
from scanlock.pipelines.starts import FromIdentity, StartPlan
from scanlock.pipelines.study import StudyPair, StudyRecord
from scanlock.registration.methods.protocol import Method
from scanlock.report.tables import Table

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_Item = TypeVar("_Item")


class Progress(Protocol):
    """Progress report of a loop."""

    def __call__(self, items: Iterable[_Item], count: int, task: str, /) -> Iterable[_Item]:
        """Yield the `count` items of a task and report the number of finished ones."""
        ...


def no_progress(items: Iterable[_Item], count: int, task: str, /) -> Iterable[_Item]:
    """Return the items without any report."""
    return items


@dataclass(frozen=True, kw_only=True, slots=True)
class Contender:
    """A registration method under the name of the paper."""

    name: str
    """Name in tables and figures."""

    method: Method[Any]
    """Registration method."""

    remark: str
    """Sentence on the settings of the paper and the deviations from them."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Claim:
    """A claim of a paper with its result on the data of the experiment."""

    statement: str
    """Claim as a statement that can be checked."""

    holds: bool | None
    """Whether the claim holds; None where the data do not decide."""

    reason: str
    """Numbers that decide."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Section:
    """A section of the page."""

    title: str
    """Heading."""

    text: str = ""
    """Paragraphs in Markdown below the heading."""

    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    """Tables by file name."""

    figures: Mapping[str, "Figure"] = field(default_factory=dict[str, "Figure"])
    """Figures by file name."""

    claims: Sequence[Claim] = ()
    """Claims of the paper with their results."""

    remarks: Sequence[str] = ()
    """Sentences of a list at the end of the section."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Findings:
    """Evaluated results of an experiment."""

    sections: Sequence[Section]
    """Sections of the page in order."""

    trajectories: Mapping[str, Sequence[Pose]] = field(default_factory=dict[str, Sequence[Pose]])
    """Poses first_from_scan of all scans, by method."""

    times: Vector = field(default_factory=lambda: np.zeros(0))
    """Times of the scans, for the trajectories [s]."""

    maps: Mapping[str, NDArray[np.float32]] = field(default_factory=dict[str, NDArray[np.float32]])
    """Points of each map in the frame of the first scan, by method [m]."""

    headline: Table | None = None
    """Summary table; by default the errors of each method."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """Registrations of an experiment."""

    series: ScanSeries
    """Registered scans."""

    pairs: Sequence[StudyPair]
    """Registered pairs of scans."""

    records: Mapping[str, Sequence[StudyRecord]]
    """Records by contender, one per pair and start, in the order of the scans."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Experiment:
    """Experiment of a paper."""

    name: str
    """Name on the command line."""

    title: str
    """Heading of the page."""

    description: str
    """Summary of the experiment in the paper, with the section."""

    contenders: Sequence[Contender]
    """Compared methods."""

    simulate: Callable[[int, int], ScanSeries]
    """Function from a number of scans and a seed to simulated scans."""

    scans: int
    """Default number of scans."""

    every: int | None
    """Stride over the scans of a recorded sequence; None where only simulated scans fit."""

    analyse: Callable[[Outcome, Progress], Findings]
    """Function from registrations to tables, figures and claims."""

    starts: StartPlan = field(default_factory=FromIdentity)
    """Initial poses."""

    pairs: Callable[[ScanSeries], Sequence[StudyPair]] = ScanSeries.pairs
    """Function from scans to pairs; by default each scan with the previous one."""

    pairs_text: str = "each with the previous one"
    """Description of the pairs on the page."""
