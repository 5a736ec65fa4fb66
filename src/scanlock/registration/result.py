"""What a registration says: the pose, whether to trust it, and how it came about."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from types import MappingProxyType
from typing import Any

from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import rotation_angle
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.registration.display import (
    Rows,
    direction_rows,
    html_table,
    metric_rows,
    text_table,
)
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance
from scanlock.registration.verification.candidate import Candidate
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability
from scanlock.registration.verification.status import Status


@dataclass(frozen=True, slots=True, eq=False)
class RegistrationResult:
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
    metrics : Metrics
        Every number that says how well the scans agree at the pose; all NaN when nothing was
        registered.
    probability : float
        How probable it is that the pose is within 0.3 m and 1 degree of the truth, in [0, 1];
        see `scanlock.registration.verification.probability`. 0 when nothing was registered.
    directions : tuple of HeldDirection
        How firmly the surfaces that both scans show hold the pose: three translations, least held
        first, then three rotations. Empty where they share too few surfaces to tell.
    history : tuple of Iteration
        Every evaluation of the objective, coarsest scale first; poses in local coordinates.
    timings : mapping of str to float [s]
        Wall time of each stage, and their ``"total"``.
    notes : tuple of str
        What was found or inferred on the way that a user may want to know.
    candidates : tuple of Candidate
        The finished poses that a method which searches had to choose from, the chosen one first;
        empty for other methods.
    covariance : PoseCovariance or None
        How sure the pose is; None where it was not asked for or, as `notes` then say, cannot be
        told.
    frames : Frames
        Where the scans lie in the caller's coordinates; see `local_target_from_source`.
    """

    target_from_source: Pose
    status: Status
    reason: str
    method: str
    metrics: Metrics
    probability: float
    directions: tuple[DirectionObservability, ...]
    history: tuple[Iteration, ...]
    timings: Mapping[str, float]
    notes: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    covariance: PoseCovariance | None = None
    frames: LocalOrigins = field(default_factory=LocalOrigins.of_sensors)

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
    def local_target_from_source(self) -> Pose:
        """The pose between the local frames, whose zeros are the origins in `frames`.

        ``local(p - source_origin) + target_origin`` is where a point p of the source lands. For
        scans in their sensors' frames it is `target_from_source`; of map coordinates it has short
        translations, and keeps its digits in tools that compute in single precision.
        """
        return self.frames.local(self.target_from_source)

    @property
    def overlap(self) -> float:
        """Share of the source that meets the target, see `Metrics`."""
        return self.metrics.overlap

    @property
    def score(self) -> float:
        """Correlation of the scans, see `Metrics`."""
        return self.metrics.score

    @property
    def runner_up_ratio(self) -> float:
        """How well the best rival agrees, see `Metrics`."""
        return self.metrics.runner_up_ratio

    @property
    def degenerate_directions(self) -> tuple[DirectionObservability, ...]:
        """The directions that the scans leave open, see `DirectionObservability.is_degenerate`."""
        return tuple(one for one in self.directions if one.is_degenerate)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and text, ready for JSON; NaN becomes None."""
        return {
            "status": self.status.value,
            "reason": self.reason,
            "method": self.method,
            "target_from_source": self.target_from_source.matrix.tolist(),
            **self.frames.as_dict(self.target_from_source),
            "probability": self.probability,
            "metrics": {name: _number(value) for name, value in asdict(self.metrics).items()},
            "directions": [
                {
                    "name": one.name,
                    "kind": one.kind,
                    "axis": one.axis.tolist(),
                    "ratio": one.ratio,
                    "deviation": one.deviation,
                    "cluster_ratio": one.cluster_ratio,
                    "is_weak": one.is_degenerate,
                }
                for one in self.directions
            ],
            "iterations": self.iterations,
            "timings_s": dict(self.timings),
            "notes": list(self.notes),
            "covariance": None if self.covariance is None else self.covariance.as_dict(),
            "candidates": [
                {
                    "target_from_source": one.target_from_source.matrix.tolist(),
                    "maker": one.proposed_by,
                    "overlap": _number(one.overlap),
                    "target_overlap": _number(one.target_overlap),
                    "score": _number(one.score),
                    "free_space_violation": _number(one.free_space_violation),
                }
                for one in self.candidates
            ],
        }

    def to_json(self) -> str:
        """Return `as_dict` as JSON; numbers keep every digit."""
        return json.dumps(self.as_dict(), indent=2, allow_nan=False)

    def __repr__(self) -> str:
        metres, degrees = self._motion()
        return (
            f"Registration(status={self.status.value}, method={self.method}, "
            f"moved={metres:.3f} m {degrees:.2f} deg, "
            f"probability={self.probability:.3f}, overlap={self.overlap:.2f}, "
            f"score={self.score:.2f}, iterations={self.iterations}, "
            f"total={1e3 * self.timings.get('total', math.nan):.1f} ms)"
        )

    def __str__(self) -> str:
        return text_table(self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._rows())

    def _motion(self) -> tuple[float, float]:
        """Return how far the source's place moves [m], and how far it turns [deg]."""
        shift = self.frames.shift(self.target_from_source, self.frames.place)
        return math.hypot(*shift), math.degrees(rotation_angle(self.target_from_source.rotation))

    def _rows(self) -> Rows:
        metres, degrees = self._motion()
        at = " at the centroid" if self.frames.is_on_map else ""
        return [
            ("status", f"{self.status.value}: {self.reason}"),
            ("probability", f"{self.probability:.3f} that the pose is right"),
            ("method", f"{self.method}, {self.iterations} evaluations"),
            ("moved", f"{metres:.3f} m{at}, {degrees:.3f} deg"),
            *metric_rows(self.metrics),
            *direction_rows(self.degenerate_directions),
            ("time", f"{1e3 * self.timings.get('total', math.nan):.1f} ms"),
            *(("note", note) for note in self.notes),
        ]

    def __reduce__(self) -> tuple[Any, ...]:
        return RegistrationResult, (
            self.target_from_source,
            self.status,
            self.reason,
            self.method,
            self.metrics,
            self.probability,
            self.directions,
            self.history,
            dict(self.timings),
            self.notes,
            self.candidates,
            self.covariance,
            self.frames,
        )


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
