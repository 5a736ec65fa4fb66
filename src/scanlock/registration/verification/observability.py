"""Observability of a pose: information along each direction, and which directions are degenerate.

Rotations are evaluated with the translation marginalised (Schur complement): metres are never
compared with radians, and the position of the axis does not matter. Translations are evaluated at
a fixed rotation, so that a rotation about a distant axis does not count as a translation too.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen, short_repr
from scanlock.geometry.pose import Pose
from scanlock.registration.verification.cluster_constraints import (
    STEP_SLICES,
    ClusterConstraints,
    MotionKind,
    quadratic_forms,
)
from scanlock.registration.verification.plane_constraints import PlaneConstraints

_AXIS_NAMES: dict[MotionKind, tuple[str, str, str]] = {
    "translation": ("forward", "left", "up"),
    "rotation": ("roll", "pitch", "yaw"),
}

_MIN_AXIS_COSINE = math.cos(math.radians(15.0))
"""Minimum cosine between a direction and the axis after which it is named."""

_MIN_RATIO: dict[MotionKind, float] = {"translation": 0.05, "rotation": 0.01}
"""Minimum observability ratio of a constrained direction. Roughness, and planes fitted across the
rings of one scan at corners, reach 0.033 along endless corridors, and 0.001 about the axis of round
rooms and tunnels."""

_MIN_CLUSTER_RATIO: dict[MotionKind, float] = {"translation": 0.15, "rotation": 0.35}
"""Minimum cluster ratio of a constrained direction. Endless corridors, tunnels, bare walls and
lines reach 0.13, plates on a sphere 0.34 about any axis. Streets, forests and yards mostly have 0.4
to 1 where planes are missing."""

_MIN_BIAS_MULTIPLE = 4.0
"""Minimum multiple of the bias from noisy normals in the information on a constrained direction of
sparse clouds. Flat ground with noise reaches 1.1 along and about any axis, also where flight strips
overlap; real tiles of terrain, forests and houses have 8 or more."""

_MIN_SPARSE_RATIO: dict[MotionKind, float] = {"translation": 0.003, "rotation": 0.001}
"""Minimum observability ratio of such a direction: slopes of 5 %. Steps of some centimetres between
flight strips are more than noise, but not steep, and differ between flights."""

_ROUNDING = 1e-12
"""Relative rounding of differences of information."""

_MIN_ROTATION_INFORMATION = 1e-3
"""Minimum of the maximum information about one axis, as a fraction of that about all axes; less is
rounding."""


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class DirectionObservability:
    """Observability of a pose along or about one axis.

    Attributes
    ----------
    kind : str
        "translation" along the axis, or "rotation" about it through the source's origin.
    axis : (3,)
        Unit vector in the target's frame, of either sign.
    ratio : float
        Information divided by its maximum, with every plane perpendicular to the motion, in
        [0, 1]. It is 1/3 for planes of all orientations, and 0 if all planes are parallel to the
        motion.
    deviation : float [m or rad]
        Standard deviation along or about the axis, if the residuals of the planes are
        independent; all other directions are marginalised.
    cluster_ratio : float
        Information of the target's clusters divided by its maximum, in [0, 1]. Poles and trunks
        have no planes, and constrain a pose nevertheless.
    bias_multiple : float
        Information over the bias from noisy normals that was subtracted from it, of sparse clouds;
        0 for others. From above, hardly any plane is steep, and all ratios are small. The few
        steep ones constrain a pose if they are more than noise.
    """

    kind: MotionKind
    axis: Vector
    ratio: float
    deviation: float
    cluster_ratio: float = 0.0
    bias_multiple: float = 0.0

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.axis)

    @property
    def name(self) -> str:
        """Forward, left, up, roll, pitch or yaw; the components of an axis that has no name."""
        nearest = int(np.argmax(np.abs(self.axis)))
        if abs(self.axis[nearest]) >= _MIN_AXIS_COSINE:
            return _AXIS_NAMES[self.kind][nearest]
        x, y, z = self.axis
        preposition = "along" if self.kind == "translation" else "about"
        return f"{preposition} ({x:.2f}, {y:.2f}, {z:.2f})"

    @property
    def is_degenerate(self) -> bool:
        """Whether neither planes nor clusters constrain the direction."""
        if self.bias_multiple >= _MIN_BIAS_MULTIPLE and self.ratio >= _MIN_SPARSE_RATIO[self.kind]:
            return False
        return (
            self.ratio < _MIN_RATIO[self.kind]
            and self.cluster_ratio < _MIN_CLUSTER_RATIO[self.kind]
        )

    def __str__(self) -> str:
        if self.kind == "translation":
            deviation = f"{self.deviation:.2g} m"
        else:
            deviation = f"{math.degrees(self.deviation):.2g} deg"
        return f"{self.name} (standard deviation {deviation}, observability ratio {self.ratio:.3f})"


@dataclass(frozen=True, kw_only=True, slots=True, eq=False)
class Observability:
    """Observability of a pose along and about all axes.

    Attributes
    ----------
    directions : tuple of DirectionObservability
        Three translations, least constrained first, then three rotations in the same order.
    information : (6, 6)
        Bias-corrected information on a step ``(rho, phi)``; see `PlaneConstraints`.
    """

    directions: tuple[DirectionObservability, ...]
    information: Matrix

    __repr__ = short_repr

    def __post_init__(self) -> None:
        frozen(self.information)

    @property
    def degenerate(self) -> tuple[DirectionObservability, ...]:
        """Degenerate directions."""
        return tuple(one for one in self.directions if one.is_degenerate)

    def fix_degenerate(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its degenerate directions as in the prior.

        Among all steps to the prior along the degenerate directions, it takes the one with the
        least increase of the point-to-plane residuals. The solution remapping of Zhang et al.
        2016 moves along the degenerate directions only.
        """
        if not self.degenerate:
            return pose
        axes = np.zeros((len(self.degenerate), 6))
        for row, one in zip(axes, self.degenerate, strict=True):
            row[STEP_SLICES[one.kind]] = one.axis
        # Minimises step' information step subject to axes step = axes difference.
        steps = np.linalg.solve(self.information, axes.T)
        step = steps @ np.linalg.solve(axes @ steps, axes @ prior.difference(pose))
        return pose.perturbed(step)


def observability_of(
    planes: PlaneConstraints, clusters: ClusterConstraints, is_sparse: bool = False
) -> Observability:
    """Compute the observability of a pose from plane constraints and the target's clusters.

    `is_sparse` says whether both clouds are sparse.
    """
    information = planes.bias_corrected_information()
    covariance = (planes.noise**2 * np.linalg.inv(information)).astype(np.float64, copy=False)
    directions: list[DirectionObservability] = []
    kinds: tuple[MotionKind, ...] = ("translation", "rotation")
    for kind in kinds:
        found = _directions(kind, _of_kind(information, kind), covariance, planes, clusters)
        directions += _with_bias_multiples(found, information, planes) if is_sparse else found
    return Observability(directions=tuple(directions), information=information)


def _of_kind(information: Matrix, kind: MotionKind) -> Matrix:
    """Return the (3, 3) information on translations, or on rotations with the rest marginalised."""
    translation = information[:3, :3]
    if kind == "translation":
        return translation
    coupling = information[3:, :3]
    return information[3:, 3:] - coupling @ np.linalg.solve(translation, coupling.T)


def _with_bias_multiples(
    directions: list[DirectionObservability], information: Matrix, planes: PlaneConstraints
) -> list[DirectionObservability]:
    """Return directions of one kind with the multiples of their biases."""
    kind, axes = directions[0].kind, np.column_stack([one.axis for one in directions])
    signals = quadratic_forms(_of_kind(information, kind), axes)
    totals = quadratic_forms(_of_kind(information + planes.bias(), kind), axes)
    # Exact planes have no bias, up to the rounding of the difference.
    biases = np.maximum(totals - signals, _ROUNDING * totals.max())
    multiples = signals / biases
    return [
        replace(one, bias_multiple=float(multiple))
        for one, multiple in zip(directions, multiples, strict=True)
    ]


def _directions(
    kind: MotionKind,
    information: Matrix,
    covariance: Matrix,
    planes: PlaneConstraints,
    clusters: ClusterConstraints,
) -> list[DirectionObservability]:
    """Return the three principal directions of the (3, 3) information, least constrained first."""
    values, axes = np.linalg.eigh(information)
    block = STEP_SLICES[kind], STEP_SLICES[kind]
    max_information = planes.max_information[block]
    # No rotation about a line of points is observable.
    smallest = _MIN_ROTATION_INFORMATION * np.trace(max_information)
    largest = np.maximum(quadratic_forms(max_information, axes), smallest)
    variances = quadratic_forms(covariance[block], axes)
    cluster_ratios = clusters.ratios(kind, axes, planes.origin)
    directions = [
        DirectionObservability(
            kind=kind,
            axis=np.ascontiguousarray(axes[:, i]),
            ratio=min(1.0, max(0.0, float(values[i] / largest[i]))),
            deviation=math.sqrt(float(variances[i])),
            cluster_ratio=float(cluster_ratios[i]),
        )
        for i in range(3)
    ]
    return sorted(directions, key=lambda one: one.ratio)
