"""What all experiments share: what is done, with what, and what of it goes onto the page."""

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


class Watch(Protocol):
    """Hands items on, and may show how many of them are done."""

    def __call__(self, items: Iterable[_Item], count: int, what: str, /) -> Iterable[_Item]:
        """Return the items, `count` of them, that do `what`."""
        ...


def unwatched(items: Iterable[_Item], count: int, what: str, /) -> Iterable[_Item]:
    """Return the items and show nothing."""
    return items


@dataclass(frozen=True, kw_only=True, slots=True)
class Contender:
    """A method as the paper names it."""

    name: str
    """Its name in tables and figures."""

    method: Method[Any]
    """What registers."""

    remark: str
    """What of the paper's settings it has, and what not: a sentence for the page."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Claim:
    """A sentence of the paper, and whether it is so here."""

    says: str
    """The sentence, as a statement that can be checked."""

    holds: bool | None
    """Whether it does; None where these data cannot tell."""

    because: str
    """The numbers that decide it."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Section:
    """A part of the page: each of its things only where there is one."""

    title: str
    """Its heading."""

    text: str = ""
    """Paragraphs in Markdown, before everything else."""

    tables: Mapping[str, Table] = field(default_factory=dict[str, Table])
    """By the names of their files."""

    figures: Mapping[str, "Figure"] = field(default_factory=dict[str, "Figure"])
    """By the names of their files."""

    claims: Sequence[Claim] = ()
    """What the paper says, held against what was found."""

    remarks: Sequence[str] = ()
    """Sentences in a list, after everything else."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Findings:
    """All that an experiment leaves behind."""

    sections: Sequence[Section]
    """Of the page, in order."""

    trajectories: Mapping[str, Sequence[Pose]] = field(default_factory=dict[str, Sequence[Pose]])
    """first_from_scan of each scan, by what found it."""

    times: Vector = field(default_factory=lambda: np.zeros(0))
    """Of the scans, for the trajectories [s]."""

    maps: Mapping[str, NDArray[np.float32]] = field(default_factory=dict[str, NDArray[np.float32]])
    """Points in the frame of the first scan, by the trajectory that laid them [m]."""

    headline: Table | None = None
    """What sums everything up; by default the errors of each method do."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcome:
    """The registrations of an experiment."""

    series: ScanSeries
    """What was registered."""

    pairs: Sequence[StudyPair]
    """Which scans with which."""

    records: Mapping[str, Sequence[StudyRecord]]
    """By contender, one record a pair and start, in the order of the scans."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Experiment:
    """One experiment of a paper."""

    name: str
    """What it is asked for by."""

    title: str
    """The heading of its page."""

    about: str
    """What the paper did, and where it says so."""

    contenders: Sequence[Contender]
    """What is compared."""

    simulated: Callable[[int, int], ScanSeries]
    """Returns simulated scans: so many, from a seed."""

    scans: int
    """How many scans, unless it is said."""

    every: int | None
    """Which scans of a recorded sequence are taken: every k-th; None where none can be."""

    examine: Callable[[Outcome, Watch], Findings]
    """Turns registrations into tables, figures and sentences."""

    starts: StartPlan = field(default_factory=FromIdentity)
    """Where registrations begin."""

    pairs: Callable[[ScanSeries], Sequence[StudyPair]] = ScanSeries.pairs
    """Which scans are registered with which: by default each with the one before."""

    pairing: str = "each with the one before"
    """The same in words, for the page."""
