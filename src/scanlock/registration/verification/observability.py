"""How firmly the surfaces that two scans share hold a pose, and along what they do not.

A rotation is looked at when the translation may give way (Schur's complement), so that metres are
never weighed against radians and it does not matter where its axis lies; a translation when the
rotation stays, so that what is a rotation about some far axis is not called a translation too.
"""

import math
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Vector, frozen
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, log_rotation
from scanlock.registration.verification.cluster_constraints import (
    PARTS,
    ClusterConstraints,
    MotionKind,
    along,
)
from scanlock.registration.verification.plane_constraints import PlaneConstraints

_NAMES: dict[MotionKind, tuple[str, str, str]] = {
    "translation": ("forward", "left", "up"),
    "rotation": ("roll", "pitch", "yaw"),
}

_NAMED = math.cos(math.radians(15.0))
"""A direction is named after an axis within 15 degrees of it."""

_LEAST_SHARE: dict[MotionKind, float] = {"translation": 0.05, "rotation": 0.01}
"""What less of the planes hold is roughness, and planes laid through the rings of one scan where
they bend at a corner: endless corridors have up to 0.033 along them, round rooms and tunnels 0.001
about their axis."""

_LEAST_PART_SHARE: dict[MotionKind, float] = {"translation": 0.15, "rotation": 0.35}
"""Endless corridors, tunnels, bare walls and lines have up to 0.13, the plates of a sphere 0.34
about any axis; streets, forests and yards mostly have 0.4 to 1 where they have no planes."""

_LEAST_LEVER = 1e-3
"""Of what all rotations together could be held by: less is rounding."""


@dataclass(frozen=True, slots=True, eq=False)
class DirectionObservability:
    """How firmly a pose is held along or about one axis.

    Attributes
    ----------
    kind : str
        "translation" along the axis, or "rotation" about it, through the source's origin.
    axis : (3,)
        Unit vector in the target's frame, of either sign.
    share : float
        Information along it over what it would be if every plane faced that motion, in [0, 1]. A
        third for planes that face everywhere alike, 0 where all planes lie along the motion.
    deviation : float [m or rad]
        Standard deviation along it that the planes leave when all else may give way, were their
        gaps independent.
    part_share : float
        How firmly the thin sides of the target's parts hold it, of what is possible, in [0, 1]:
        poles and crowns are no planes and hold it all the same.
    """

    kind: MotionKind
    axis: Vector
    ratio: float
    deviation: float
    cluster_ratio: float = 0.0

    def __post_init__(self) -> None:
        frozen(self.axis)

    @property
    def name(self) -> str:
        """Forward, left or up; roll, pitch or yaw; or the axis where it lies between."""
        nearest = int(np.argmax(np.abs(self.axis)))
        if abs(self.axis[nearest]) >= _NAMED:
            return _NAMES[self.kind][nearest]
        x, y, z = self.axis
        about = "along" if self.kind == "translation" else "about"
        return f"{about} ({x:.2f}, {y:.2f}, {z:.2f})"

    @property
    def is_degenerate(self) -> bool:
        """Whether so little holds it that the pose may be wrong along it by any amount."""
        return (
            self.ratio < _LEAST_SHARE[self.kind]
            and self.cluster_ratio < _LEAST_PART_SHARE[self.kind]
        )

    def __str__(self) -> str:
        if self.kind == "translation":
            return f"{self.name} (deviation {self.deviation:.2g} m, hold {self.ratio:.3f} of 1)"
        degrees = math.degrees(self.deviation)
        return f"{self.name} (deviation {degrees:.2g} deg, hold {self.ratio:.3f} of 1)"


@dataclass(frozen=True, slots=True, eq=False)
class Observability:
    """How firmly the planes that two scans share hold a pose.

    Attributes
    ----------
    directions : tuple of HeldDirection
        Three translations, least held first, then three rotations likewise.
    information : (6, 6)
        Of a step ``(rho, phi)`` in the target's frame, about the source's origin, in planes,
        less what may be noise; see `PlaneConstraints`.
    """

    directions: tuple[DirectionObservability, ...]
    information: Matrix

    def __post_init__(self) -> None:
        frozen(self.information)

    @property
    def degenerate(self) -> tuple[DirectionObservability, ...]:
        """The directions that nothing holds."""
        return tuple(one for one in self.directions if one.is_degenerate)

    def fix_degenerate(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its weak directions as in the prior, at the least cost elsewhere.

        Of all steps that end where the prior is along and about the weak axes it is the one that
        the planes resist least; cf. the remapping of solutions by Zhang et al. 2016, which moves
        along the weak axes alone.
        """
        if not self.degenerate:
            return pose
        rows = np.zeros((len(self.degenerate), 6))
        for row, one in zip(rows, self.degenerate, strict=True):
            row[PARTS[one.kind]] = one.axis
        apart = np.concatenate(
            [prior.translation - pose.translation, log_rotation(prior.rotation @ pose.rotation.T)]
        )
        ways = np.linalg.solve(self.information, rows.T)
        step = ways @ np.linalg.solve(rows @ ways, rows @ apart)
        return Pose(exp_rotation(step[3:]) @ pose.rotation, pose.translation + step[:3])


def observability_of(footing: PlaneConstraints, by_parts: ClusterConstraints) -> Observability:
    """Return the hold of planes, and of the target's parts."""
    sure = footing.bias_corrected_information()
    coupling = sure[3:, :3]
    turning = sure[3:, 3:] - coupling @ np.linalg.solve(sure[:3, :3], coupling.T)
    max_information, origin = footing.max_information, footing.origin
    spread = (footing.noise**2 * np.linalg.inv(sure)).astype(np.float64, copy=False)
    return Observability(
        (
            *_directions("translation", sure[:3, :3], max_information, spread, by_parts, origin),
            *_directions("rotation", turning, max_information, spread, by_parts, origin),
        ),
        sure,
    )


def _directions(
    kind: MotionKind,
    information: Matrix,
    max_information: Matrix,
    spread: Matrix,
    by_parts: ClusterConstraints,
    origin: Vector,
) -> list[DirectionObservability]:
    held, axes = np.linalg.eigh(information)
    own = PARTS[kind], PARTS[kind]
    most = along(max_information[own], axes)
    # About a line that all places lie on nothing could be held.
    most = np.maximum(most, _LEAST_LEVER * np.trace(max_information[own]))
    variances = along(spread[own], axes)
    by_part = by_parts.shares(kind, axes, origin)
    found = [
        DirectionObservability(
            kind,
            np.ascontiguousarray(axes[:, i]),
            min(1.0, max(0.0, float(held[i] / most[i]))),
            math.sqrt(float(variances[i])),
            float(by_part[i]),
        )
        for i in range(3)
    ]
    return sorted(found, key=lambda one: one.ratio)
