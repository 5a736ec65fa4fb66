"""The result of a registration: pose, status, metrics, covariance and history."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from types import MappingProxyType
from typing import Any

import numpy as np

from scanlock.arrays import Matrix, frozen
from scanlock.geometry.pose import Pose
from scanlock.optimisation.solvers.solution import Iteration
from scanlock.registration.display import (
    Rows,
    accuracy_text,
    direction_rows,
    html_table,
    matrix_lines,
    metric_rows,
    motion_rows,
    overlap_rows,
    text_table,
    triple,
)
from scanlock.registration.local_origins import LocalOrigins
from scanlock.registration.uncertainty.accuracy import PoseAccuracy
from scanlock.registration.uncertainty.pose_covariance import PoseCovariance
from scanlock.registration.verification.candidate import Candidate
from scanlock.registration.verification.metrics import Metrics
from scanlock.registration.verification.observability import DirectionObservability
from scanlock.registration.verification.status import Status


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class RegistrationResult:
    """The result of registering a source scan to a target scan; true if `ok`.

    Attributes
    ----------
    target_from_source : Pose
        Maps points of the source into the frame of the target, both as the caller gave them. If
        `status` is not `OK` it is the best pose found, not a pose to trust.
    status : Status
    reason : str
        One sentence that explains the status.
    method : str
        Name of the method, a key of `METHODS`.
    metrics : Metrics
        Overlap, residuals and free-space violation at the pose; all NaN if nothing was registered.
    probability : float
        Probability that the pose is within 0.3 m, times `length_scale`, and 1 degree of the
        truth, in [0, 1]; see `scanlock.registration.verification.probability`. 0 if nothing was
        registered, NaN without verification.
    directions : tuple of DirectionObservability
        Observability of three translations, least constrained first, then of three rotations.
        Empty if the scans share too few surfaces.
    converged : bool
        Whether the solver converged; says nothing about the pose being right.
    hessian : (6, 6) or None
        Hessian of the objective of the method at the pose, for a step ``(rho, phi)`` of
        `Pose.retract` between the local frames, at its finest scale. A mean over the observations.
    history : tuple of Iteration
        Every evaluation of the objective, coarsest scale first; poses between the local frames.
    timings : mapping of str to float [s]
        Wall time of each stage, and their ``"total"``.
    notes : tuple of str
        Facts about the scans and the registration that a user may want to know.
    candidates : tuple of Candidate
        The finished poses of a method that searches, best first; empty for other methods.
    covariance : PoseCovariance or None
        Covariance of the pose; None without ``covariance=``, or if a note says why there is none.
    accuracy : PoseAccuracy or None
        Standard deviations of the pose at the centroid of the overlap; None without a covariance.
    origins : LocalOrigins
        Origins of the local frames in the caller's coordinates; see `local_target_from_source`.
    length_scale : float
        Factor of the lengths of all settings and of the verification: 1, and more for a sparse
        pair; see `scanlock.clouds.length_scale`.
    """

    target_from_source: Pose
    status: Status
    reason: str
    method: str
    metrics: Metrics = field(default_factory=Metrics)
    probability: float = 0.0
    directions: tuple[DirectionObservability, ...] = ()
    converged: bool = False
    hessian: Matrix | None = None
    history: tuple[Iteration, ...] = ()
    timings: Mapping[str, float] = field(default_factory=dict[str, float])
    notes: tuple[str, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    covariance: PoseCovariance | None = None
    accuracy: PoseAccuracy | None = None
    origins: LocalOrigins = field(default_factory=LocalOrigins.of_sensors)
    length_scale: float = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "timings", MappingProxyType(dict(self.timings)))
        if self.hessian is not None:
            frozen(self.hessian)

    def __bool__(self) -> bool:
        return self.ok

    @property
    def ok(self) -> bool:
        """Whether the pose is verified and can be used without a look at the scans."""
        return self.status is Status.OK

    @property
    def transformation(self) -> Matrix:
        """The (4, 4) matrix of `target_from_source`, a fresh copy."""
        return self.target_from_source.matrix

    @property
    def fitness(self) -> float:
        """Ratio of the source's query points with a surface of the target, see `Metrics`."""
        return self.metrics.fitness

    @property
    def inlier_rmse(self) -> float:
        """RMS residual of those points [m], see `Metrics`."""
        return self.metrics.inlier_rmse

    @property
    def evaluations(self) -> int:
        """Number of evaluations of the objective, over all scales and starts."""
        return len(self.history)

    @property
    def local_target_from_source(self) -> Pose:
        """The pose between the local frames, whose zeros are the `origins`.

        ``local(p - source_origin) + target_origin`` is where a point p of the source lands. For
        scans in their sensors' frames it is `target_from_source`; of map coordinates it has short
        translations, and keeps its digits in tools that compute in single precision.
        """
        return self.origins.local(self.target_from_source)

    @property
    def overlap(self) -> float:
        """Ratio of the source that overlaps the target, see `Metrics`."""
        return self.metrics.overlap

    @property
    def score(self) -> float:
        """Normalised D2D score of the scans, see `Metrics`."""
        return self.metrics.score

    @property
    def runner_up_ratio(self) -> float:
        """Score of the runner-up over that of the pose, see `Metrics`."""
        return self.metrics.runner_up_ratio

    @property
    def degenerate_directions(self) -> tuple[DirectionObservability, ...]:
        """The directions that the overlapping geometry does not constrain."""
        return tuple(one for one in self.directions if one.is_degenerate)

    def as_dict(self) -> dict[str, Any]:
        """Return the result as plain numbers and text, ready for JSON; NaN becomes None."""
        return {
            "status": self.status.value,
            "reason": self.reason,
            "method": self.method,
            "target_from_source": self.target_from_source.matrix.tolist(),
            **self.origins.as_dict(self.target_from_source),
            "probability": _number(self.probability),
            "length_scale": self.length_scale,
            "metrics": {name: _number(value) for name, value in asdict(self.metrics).items()},
            "directions": [
                {
                    "name": one.name,
                    "kind": one.kind,
                    "axis": one.axis.tolist(),
                    "ratio": one.ratio,
                    "deviation": one.deviation,
                    "cluster_ratio": one.cluster_ratio,
                    "bias_multiple": one.bias_multiple,
                    "is_degenerate": one.is_degenerate,
                }
                for one in self.directions
            ],
            "evaluations": self.evaluations,
            "timings_s": dict(self.timings),
            "notes": list(self.notes),
            "covariance": None if self.covariance is None else self.covariance.as_dict(),
            "accuracy": None if self.accuracy is None else self.accuracy.as_dict(),
            "candidates": [
                {
                    "target_from_source": one.target_from_source.matrix.tolist(),
                    "proposed_by": one.proposed_by,
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

    def details(self) -> str:
        """Return the printed form with every metric, the deviations of each axis, and the times."""
        return text_table([*self.summary_rows(), *self.detail_rows()])

    def summary_rows(self) -> Rows:
        """Return names and values of what a caller needs first: status, accuracy and pose."""
        found = self.status is not Status.NO_CORRESPONDENCES
        rows = [("status", self.status.value if self.ok else f"{self.status.value}: {self.reason}")]
        if found:
            rows.append(("accuracy", accuracy_text(self.probability, self.accuracy)))
            rows += motion_rows(self.target_from_source, self.origins)
            rows += overlap_rows(self.metrics)
        rows += direction_rows(self.degenerate_directions)
        if found:
            rows.append(("pose", "\n".join(self.matrix_lines())))
        return rows

    def detail_rows(self) -> Rows:
        """Return names and values of all that explains a result."""
        rows = [
            ("method", f"{self.method}, {self.evaluations} evaluations"),
            ("reason", self.reason),
        ]
        if self.accuracy is not None:
            at = triple(self.accuracy.point, 1)
            rows.append(("deviations", f"{self.accuracy.details()}, at {at} m"))
        rows += metric_rows(self.metrics)
        if self.candidates:
            best = self.candidates[0].proposed_by
            rows.append(("candidates", f"{len(self.candidates)}, the best by {best}"))
        return rows

    def matrix_lines(self) -> list[str]:
        """Return the four rows of `transformation` as text; every digit for map coordinates."""
        origins = self.origins
        on_map = origins.is_on_map or bool(origins.target_origin.any())
        return matrix_lines(self.target_from_source, on_map=on_map)

    def __repr__(self) -> str:
        sigma = "" if self.accuracy is None else f", accuracy={self.accuracy}"
        return (
            f"RegistrationResult({self.status.value}, {self.method}, "
            f"probability={self.probability:.3f}{sigma}, "
            f"target_from_source={self.target_from_source})"
        )

    def __str__(self) -> str:
        return text_table(self._rows())

    def _repr_html_(self) -> str:
        return html_table(self._rows())

    def _rows(self) -> Rows:
        on_scans = ("source: ", "target: ")
        notes = [note for note in self.notes if not (self.ok and note.startswith(on_scans))]
        return [*self.summary_rows(), *(("note", note) for note in notes)]

    def __reduce__(self) -> tuple[Any, ...]:
        values = {one.name: getattr(self, one.name) for one in fields(self)}
        if self.hessian is not None:
            values["hessian"] = np.array(self.hessian)
        return _rebuilt, ({**values, "timings": dict(self.timings)},)


def _rebuilt(values: dict[str, Any]) -> RegistrationResult:
    return RegistrationResult(**values)


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value
