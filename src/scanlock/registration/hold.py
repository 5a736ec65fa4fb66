"""How firmly the surfaces that two scans share hold a pose, and along what they do not.

A plane holds a translation along its normal, and a rotation that moves it along its normal. Summed
over the planes that the probes of the source meet, that is an information matrix of the pose. A
rotation is looked at when the translation may give way (Schur's complement), so that metres are
never weighed against radians and it does not matter where its axis lies; a translation when the
rotation stays, so that what is a rotation about some far axis is not called a translation too.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scanlock.arrays import Matrix, Points, Vector, frozen
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation, hats, log_rotation
from scanlock.models.probed_surface import ProbedSurface
from scanlock.registration.part_hold import PARTS, MotionKind, PartHold

_NAMES: dict[MotionKind, tuple[str, str, str]] = {
    "translation": ("forward", "left", "up"),
    "rotation": ("roll", "pitch", "yaw"),
}

_NAMED = math.cos(math.radians(15.0))
"""A direction is named after an axis within 15 degrees of it."""

_LEAST_FLATNESS = 0.9
"""Of a surface that counts as a plane: across, its deviation is a third of that along it."""

_ROUGHNESS = 0.1
"""Gaps of this [m] halve the weight of a plane: it is not the same surface."""

_LEAST_SHARE: dict[MotionKind, float] = {"translation": 0.05, "rotation": 0.01}
"""What less of the planes hold is roughness, and planes laid through the rings of one scan where
they bend at a corner: endless corridors have up to 0.033 along them, round rooms and tunnels 0.001
about their axis."""

_LEAST_PART_SHARE: dict[MotionKind, float] = {"translation": 0.15, "rotation": 0.35}
"""Endless corridors, tunnels, bare walls and lines have up to 0.13, the plates of a sphere 0.34
about any axis; streets, forests and yards mostly have 0.4 to 1 where they have no planes."""

_LEAST_PLANES = 12
"""Fewer planes say nothing: twice the six numbers of a pose."""

_LEAST_LEVER = 1e-3
"""Of what all rotations together could be held by: less is rounding."""

_DAMPING = 0.01
"""Share of the planes that resist any step: along what nothing holds there is none to take."""

_LEAST_NOISE = 0.01
"""Deviation of a gap [m] that is assumed at least, however well a few planes fit."""


@dataclass(frozen=True, slots=True, eq=False)
class HeldDirection:
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
    share: float
    deviation: float
    part_share: float = 0.0

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
    def is_weak(self) -> bool:
        """Whether so little holds it that the pose may be wrong along it by any amount."""
        return (
            self.share < _LEAST_SHARE[self.kind] and self.part_share < _LEAST_PART_SHARE[self.kind]
        )

    def __str__(self) -> str:
        if self.kind == "translation":
            return f"{self.name} (deviation {self.deviation:.2g} m, hold {self.share:.3f} of 1)"
        degrees = math.degrees(self.deviation)
        return f"{self.name} (deviation {degrees:.2g} deg, hold {self.share:.3f} of 1)"


@dataclass(frozen=True, slots=True, eq=False)
class Hold:
    """How firmly the planes that two scans share hold a pose.

    Attributes
    ----------
    directions : tuple of HeldDirection
        Three translations, least held first, then three rotations likewise.
    step : (6,) [m, rad]
        Of Gauss and Newton onto the planes, slightly damped, ``(rho, phi)`` in the target's frame,
        about the source's origin.
    information : (6, 6)
        Of a step ``(rho, phi)`` in the target's frame, about the source's origin, in planes: one
        plane whose normal is along a direction adds one.
    """

    directions: tuple[HeldDirection, ...]
    step: Vector
    information: Matrix

    def __post_init__(self) -> None:
        frozen(self.step)
        frozen(self.information)

    @property
    def weak(self) -> tuple[HeldDirection, ...]:
        """The directions that nothing holds."""
        return tuple(one for one in self.directions if one.is_weak)

    def given_back(self, pose: Pose, prior: Pose) -> Pose:
        """Return the pose with its weak directions as in the prior, at the least cost elsewhere.

        Of all steps that end where the prior is along and about the weak axes it is the one that
        the planes resist least; cf. the remapping of solutions by Zhang et al. 2016, which moves
        along the weak axes alone.
        """
        if not self.weak:
            return pose
        rows = np.zeros((len(self.weak), 6))
        for row, one in zip(rows, self.weak, strict=True):
            row[PARTS[one.kind]] = one.axis
        apart = np.concatenate(
            [prior.translation - pose.translation, log_rotation(prior.rotation @ pose.rotation.T)]
        )
        ways = np.linalg.solve(self.information, rows.T)
        step = ways @ np.linalg.solve(rows @ ways, rows @ apart)
        return Pose(exp_rotation(step[3:]) @ pose.rotation, pose.translation + step[:3])


def hold_at(surface: ProbedSurface, origin: Vector, by_parts: PartHold) -> Hold | None:
    """Return the hold of the planes about the source's origin (3,) [m] in the target's frame.

    None where too few planes are met to tell. `by_parts` is that of the target's parts.
    """
    flat = surface.flatness > _LEAST_FLATNESS
    if np.count_nonzero(flat) < _LEAST_PLANES:
        return None
    normals, gaps = surface.normals[flat], surface.gaps[flat]
    weights = 1.0 / (1.0 + (gaps / _ROUGHNESS) ** 2)
    places = surface.places[flat] - origin
    rows = np.hstack([normals, np.cross(places, normals)])
    information = (weights[:, None] * rows).T @ rows
    most = _most(places, weights)
    step = -np.linalg.solve(_supported(information + _DAMPING * most), (weights * gaps) @ rows)
    noise = max(_LEAST_NOISE, math.sqrt(float(weights @ gaps**2 / weights.sum())))
    sure = _supported(information - _doubtful(places, surface.doubts[flat], weights))
    coupling = sure[3:, :3]
    turning = sure[3:, 3:] - coupling @ np.linalg.solve(sure[:3, :3], coupling.T)
    spread = (noise**2 * np.linalg.inv(sure)).astype(np.float64, copy=False)
    return Hold(
        (
            *_directions("translation", sure[:3, :3], most, spread, by_parts, origin),
            *_directions("rotation", turning, most, spread, by_parts, origin),
        ),
        step.astype(np.float64, copy=False),
        sure,
    )


def _doubtful(places: Points, doubts: NDArray[np.float64], weights: Vector) -> Matrix:
    """Return what of the information comes from noise of the normals alone.

    A normal that is off sees motions along its plane, in an endless corridor those along it too.
    """
    levers = np.concatenate([np.broadcast_to(np.eye(3), doubts.shape), hats(places)], axis=1)
    return np.einsum("k,kia,kab,kjb->ij", weights, levers, doubts, levers, optimize=True)


def _most(places: Points, weights: Vector) -> Matrix:
    """Return the information if every plane faced every motion of its place."""
    most = np.zeros((6, 6))
    most[:3, :3] = weights.sum() * np.eye(3)
    squares = (weights[:, None] * places).T @ places
    most[3:, 3:] = np.trace(squares) * np.eye(3) - squares
    return most


def _supported(information: Matrix) -> Matrix:
    """Return the information, at least a millionth of what is held in its own unit, everywhere.

    What no plane holds at all must not end the arithmetic, nor what noise leaves below nothing.
    """
    units = np.sqrt(
        np.repeat([np.trace(information[:3, :3]), np.trace(information[3:, 3:])], 3) / 3.0
    )
    units = np.maximum(units, 1e-9)
    held, axes = np.linalg.eigh(information / np.outer(units, units))
    return (axes * np.maximum(held, 1e-6)) @ axes.T * np.outer(units, units)


def _directions(
    kind: MotionKind,
    information: Matrix,
    most: Matrix,
    spread: Matrix,
    by_parts: PartHold,
    origin: Vector,
) -> list[HeldDirection]:
    held, axes = np.linalg.eigh(information)
    own = PARTS[kind], PARTS[kind]
    possible = np.einsum("ia,ij,ja->a", axes, most[own], axes)
    # About a line that all places lie on nothing could be held.
    possible = np.maximum(possible, _LEAST_LEVER * np.trace(most[own]))
    variances = np.einsum("ia,ij,ja->a", axes, spread[own], axes)
    by_part = by_parts.shares(kind, axes, origin)
    found = [
        HeldDirection(
            kind,
            np.ascontiguousarray(axes[:, i]),
            min(1.0, max(0.0, float(held[i] / possible[i]))),
            math.sqrt(float(variances[i])),
            float(by_part[i]),
        )
        for i in range(3)
    ]
    return sorted(found, key=lambda one: one.share)
