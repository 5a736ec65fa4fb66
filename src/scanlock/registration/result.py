"""What a registration says: the pose, whether to trust it, and how it came about."""

import enum
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from scanlock.geometry.pose import Pose
from scanlock.registration.candidate import Candidate, second_best
from scanlock.solvers.solution import Iteration


class Status(enum.Enum):
    """How a registration ended; only `OK` is a pose to use unseen."""

    OK = "ok"
    """The solver converged and the scans overlap at the pose."""

    LOW_OVERLAP = "low_overlap"
    """The solver converged, but too little of the source meets the target at the pose."""

    DEGENERATE = "degenerate"
    """The scans look alike when shifted along some direction; the pose may be wrong along it."""

    AMBIGUOUS = "ambiguous"
    """Another pose, not near the one chosen, agrees nearly as well."""

    NOT_CONVERGED = "not_converged"
    """The iteration limit came first; the pose is the best seen."""

    NO_FEATURES = "no_features"
    """A scan holds too few parts to register; the pose is the initial one, untouched."""

    NO_SUPPORT = "no_support"
    """Nothing of the two scans meets; the initial pose is returned untouched."""


@dataclass(frozen=True, slots=True, eq=False)
class Registration:
    """The result of registering a source scan to a target scan.

    Attributes
    ----------
    target_from_source : Pose
        Carries points of the source into the frame of the target, both as the caller gave them.
        When `status` is not `OK` it is the best pose seen, not a pose to trust.
    status : Status
    reason : str
        One sentence that explains the status.
    method : str
        Name of the method, a key of `METHODS`.
    overlap : float
        Share of the source's parts, by weight, that meet a part of the target at the pose
        within three standard deviations, in [0, 1]; NaN when nothing was registered.
    score : float
        Correlation of the two scans' Gaussians at the pose, in [0, 1]: 1 for identical scans;
        NaN when nothing was registered.
    history : tuple of Iteration
        Every evaluation of the objective, coarsest scale first; poses in local coordinates.
    timings : mapping of str to float [s]
        Wall time of each stage, and their ``"total"``.
    notes : tuple of str
        What was found or inferred on the way that a user may want to know.
    candidates : tuple of Candidate
        The finished poses that a method which searches had to choose from, the chosen one first;
        empty for other methods.
    """

    target_from_source: Pose
    status: Status
    reason: str
    method: str
    overlap: float
    score: float
    history: tuple[Iteration, ...]
    timings: Mapping[str, float]
    notes: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "timings", MappingProxyType(dict(self.timings)))

    @property
    def ok(self) -> bool:
        """Whether the pose can be used unseen."""
        return self.status is Status.OK

    @property
    def iterations(self) -> int:
        """Evaluations of the objective over all scales."""
        return len(self.history)

    @property
    def second_best(self) -> float:
        """Agreement of the best rival as a share of the chosen pose's.

        0 where none was left at the end, near 1 for a toss-up; NaN for methods that do not search.
        """
        return second_best(self.candidates)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and text, ready for JSON; NaN becomes None."""
        return {
            "status": self.status.value,
            "reason": self.reason,
            "method": self.method,
            "target_from_source": self.target_from_source.matrix.tolist(),
            "overlap": _number(self.overlap),
            "score": _number(self.score),
            "iterations": self.iterations,
            "timings_s": dict(self.timings),
            "notes": list(self.notes),
            "second_best": _number(self.second_best),
            "candidates": [
                {
                    "target_from_source": one.target_from_source.matrix.tolist(),
                    "maker": one.maker,
                    "overlap": _number(one.overlap),
                    "score": _number(one.score),
                    "violation": _number(one.violation),
                }
                for one in self.candidates
            ],
        }

    def to_json(self) -> str:
        """Return `as_dict` as JSON; numbers keep every digit."""
        return json.dumps(self.as_dict(), indent=2, allow_nan=False)

    def __repr__(self) -> str:
        pose = self.target_from_source
        metres, radians = pose.distance(Pose.identity())
        return (
            f"Registration(status={self.status.value}, method={self.method}, "
            f"moved={metres:.3f} m {math.degrees(radians):.2f} deg, overlap={self.overlap:.2f}, "
            f"score={self.score:.2f}, iterations={self.iterations}, "
            f"total={1e3 * self.timings.get('total', math.nan):.1f} ms)"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        return Registration, (
            self.target_from_source,
            self.status,
            self.reason,
            self.method,
            self.overlap,
            self.score,
            self.history,
            dict(self.timings),
            self.notes,
            self.candidates,
        )


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
