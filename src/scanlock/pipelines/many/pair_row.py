"""The result of one pair as a row of a table."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from scanlock.arrays import Matrix
from scanlock.geometry.quaternions import pose_from_quaternion
from scanlock.geometry.rotations import quaternion_from_rotation, rotation_angle
from scanlock.registration.result import RegistrationResult

ERROR = "error"
"""Status of a row whose scans could not be read or registered."""

COLUMNS = (
    "name", "source", "target", "status", "ok", "probability", "reason", "error", "method",
    "x", "y", "z", "qx", "qy", "qz", "qw", "translation", "rotation",
    "overlap", "target_overlap", "score",
    "sigma_x", "sigma_y", "sigma_z", "sigma_roll", "sigma_pitch", "sigma_yaw",
    "notes", "seconds",
)  # fmt: skip
"""Names of the values of `PairRow.as_dict`, in order."""

_POSE = ("x", "y", "z", "qx", "qy", "qz", "qw")
_DEVIATIONS = ("sigma_x", "sigma_y", "sigma_z", "sigma_roll", "sigma_pitch", "sigma_yaw")


@dataclass(frozen=True, kw_only=True, slots=True)
class PairRow:
    """The result of one pair, in plain numbers and text."""

    name: str
    """Name of the pair."""

    source: str
    """Path of the scan that moves; empty for an array."""

    target: str
    """Path of the scan that stays; empty for an array."""

    status: str
    """Value of a `Status`, or ``"error"`` if a scan could not be read or is invalid."""

    reason: str
    """One sentence that explains the status; the message of an error."""

    error: str = ""
    """Type of the error, such as ``"FormatError"``; empty without an error."""

    method: str = ""
    """Name of the method; empty after an error."""

    probability: float | None = None
    """Probability that the pose is right, as in `RegistrationResult`."""

    pose: tuple[float, ...] | None = None
    """Pose, target from source: x, y, z [m], qx, qy, qz, qw; None after an error."""

    translation: float | None = None
    """Shift of the source [m]: of its sensor, or of its centroid for map coordinates."""

    rotation: float | None = None
    """Angle of the rotation [rad]."""

    overlap: float | None = None
    """Ratio of the source that overlaps the target."""

    target_overlap: float | None = None
    """Ratio of the target that overlaps the source."""

    score: float | None = None
    """Normalised score, 1 for identical scans."""

    deviations: tuple[float, ...] | None = None
    """Standard deviations of `RegistrationResult.accuracy` along and about its axes [m, rad]; None
    without a covariance."""

    notes: tuple[str, ...] = ()
    """Facts about the scans and the registration."""

    extra: Mapping[str, str] = field(default_factory=dict[str, str])
    """Further values of the pair."""

    seconds: float | None = field(default=None, compare=False)
    """Wall time of reading, preparing and registering [s]; ignored when rows are compared."""

    @property
    def ok(self) -> bool:
        """Whether the pose is verified."""
        return self.status == "ok"

    @property
    def target_from_source(self) -> Matrix | None:
        """The pose as a (4, 4) matrix; None after an error."""
        if self.pose is None:
            return None
        x, y, z, *vector, scalar = self.pose
        return pose_from_quaternion((x, y, z), (scalar, *vector)).matrix

    def as_dict(self) -> dict[str, Any]:
        """Return the values by column, then the further ones; None where a number is unknown."""
        values: dict[str, Any] = {name: getattr(self, name, None) for name in COLUMNS}
        for names, numbers in ((_POSE, self.pose), (_DEVIATIONS, self.deviations)):
            values |= zip(names, numbers or (None,) * len(names), strict=True)
        values["notes"] = "; ".join(self.notes)
        return values | dict(self.extra)


class PairRows(Iterator[PairRow]):
    """Rows in the order of the pairs, each as soon as it and all before it are known."""

    def __init__(self, rows: Iterator[PairRow]) -> None:
        self._rows = rows

    def __iter__(self) -> "PairRows":
        return self

    def __next__(self) -> PairRow:
        return next(self._rows)

    def to_dicts(self) -> list[dict[str, Any]]:
        """Return all remaining rows as dictionaries, the argument of ``pandas.DataFrame``."""
        return [row.as_dict() for row in self]

    def close(self) -> None:
        """Stop the workers without waiting for pairs that have not started."""
        close = getattr(self._rows, "close", None)
        if close is not None:
            close()


def row_of_result(
    name: str,
    scans: tuple[str, str],
    result: RegistrationResult,
    extra: Mapping[str, str],
) -> PairRow:
    """Return the row of a registration; `scans` are the paths of source and target."""
    pose, metrics = result.target_from_source, result.metrics
    shift = result.origins.shift(pose, result.origins.reference_point)
    accuracy = result.accuracy
    scalar, *vector = quaternion_from_rotation(pose.rotation).tolist()
    return PairRow(
        name=name,
        source=scans[0],
        target=scans[1],
        status=result.status.value,
        reason=result.reason,
        method=result.method,
        probability=_known(result.probability),
        pose=(*pose.translation.tolist(), *vector, scalar),
        translation=math.hypot(*shift.tolist()),
        rotation=float(rotation_angle(pose.rotation)),
        overlap=_known(metrics.overlap),
        target_overlap=_known(metrics.target_overlap),
        score=_known(metrics.score),
        deviations=(
            None
            if accuracy is None
            else (*accuracy.translation.tolist(), *accuracy.rotation.tolist())
        ),
        notes=tuple(result.notes),
        extra=extra,
    )


def row_of_error(
    name: str, scans: tuple[str, str], error: BaseException, extra: Mapping[str, str]
) -> PairRow:
    """Return the row of a pair that raised an error."""
    return PairRow(
        name=name,
        source=scans[0],
        target=scans[1],
        status=ERROR,
        reason=" ".join(_message(error).split()),
        error=type(error).__name__,
        extra=extra,
    )


def _message(error: BaseException) -> str:
    if isinstance(error, OSError) and error.strerror is not None and error.filename is not None:
        return f"{error.filename}: {error.strerror[:1].lower()}{error.strerror[1:]}"
    return str(error) or type(error).__name__


def _known(value: float) -> float | None:
    return None if math.isnan(value) else float(value)
