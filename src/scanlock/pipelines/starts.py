"""Initial poses of the registrations of a study: identity, fixed motions, or perturbed truth."""

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_at_least, require_count
from scanlock.geometry.pose import Pose
from scanlock.geometry.rotations import exp_rotation

StartAxis = Literal["vertical", "random"]
"""Directions of a perturbation: about the vertical with a nearly level shift, or random."""

_VERTICAL_SHARE = 0.1
"""Factor on the vertical component of the shift for the axis ``"vertical"``."""


class StartPlan(Protocol):
    """The named initial poses of every pair."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the starts, in order; the same for all pairs."""
        ...

    @property
    def rule(self) -> str:
        """Text that identifies all inputs of a start besides its name and its pair."""
        ...

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the initial pose of a pair, target from source.

        Parameters
        ----------
        name : str
            One of `names`.
        pair : str
            Name of the pair.
        truth : Pose or None
            True pose of the pair, where known.
        centre : (3,) [m]
            Centre of rotation, in the source frame.
        """
        ...


@dataclass(frozen=True, slots=True)
class FromIdentity:
    """One start for every pair: the identity."""

    @property
    def names(self) -> tuple[str, ...]:
        """The single name ``"identity"``."""
        return ("identity",)

    @property
    def rule(self) -> str:
        """The text ``"identity"``."""
        return "identity"

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the identity pose."""
        return Pose.identity()


@dataclass(frozen=True, kw_only=True, slots=True)
class Displaced:
    """The same given motions as starts of every pair, independent of the true pose.

    Starting from a motion is equivalent to moving the source by it and starting from the identity.
    """

    motions: Mapping[str, Pose]
    """Named motions, whose rotation is about the centre of the source."""

    def __post_init__(self) -> None:
        if not self.motions:
            raise InvalidInput("motions must hold at least one start, got none")

    @property
    def names(self) -> tuple[str, ...]:
        """One name for every motion."""
        return tuple(self.motions)

    @property
    def rule(self) -> str:
        """Names and matrices of the motions."""
        return "; ".join(
            f"{name}: {pose.matrix[:3].tolist()}" for name, pose in self.motions.items()
        )

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the motion of this name, applied about `centre`."""
        motion = self.motions[name]
        return Pose(motion.rotation, centre + motion.translation - motion.rotation @ centre)


@dataclass(frozen=True, kw_only=True, slots=True)
class AroundTruth:
    """Perturbations of the true pose by given distances and angles, in random directions.

    Each start is the true pose, translated and rotated about the centre of the source by exactly
    the given distance and angle. It depends only on the seed, its name and the name of the pair.
    """

    distances: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 8.0)
    """Distances by which starts are off in translation [m], ascending."""

    angles: tuple[float, ...] = tuple(math.radians(angle) for angle in (0.0, 10.0, 20.0, 40.0))
    """Angles by which starts are off in rotation [rad], ascending; combined with every distance."""

    repeats: int = 1
    """Number of starts for each combination of a distance and an angle."""

    axis: StartAxis = "vertical"
    """Directions of the perturbations; see `StartAxis`."""

    seed: int = 0
    """Seed of the random directions."""

    def __post_init__(self) -> None:
        for name, values in (("distances", self.distances), ("angles", self.angles)):
            if not values or list(values) != sorted(set(values)):
                raise InvalidInput(f"{name} must be strictly ascending, got {values}")
            require_at_least(name, values[0], 0.0)
            require_at_least(name, values[-1], 0.0)
        if self.angles[-1] > math.pi:
            raise InvalidInput(f"angles must be at most pi rad, got {self.angles[-1]} rad")
        require_count("repeats", self.repeats)
        require_count("seed", self.seed, minimum=0)
        if self.axis not in ("vertical", "random"):
            raise InvalidInput(f"axis must be 'vertical' or 'random', got {self.axis!r}")

    @property
    def names(self) -> tuple[str, ...]:
        """One name for every distance, angle and repeat."""
        return tuple(self.levels)

    @property
    def rule(self) -> str:
        """Axis and seed."""
        return f"{self.axis}, seed {self.seed}"

    @property
    def levels(self) -> Mapping[str, tuple[float, float]]:
        """Distance [m] and angle [rad] of each start, by its name."""
        return {
            f"{distance:g} m, {math.degrees(angle):g} deg, {repeat}": (distance, angle)
            for distance in self.distances
            for angle in self.angles
            for repeat in range(1, self.repeats + 1)
        }

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the true pose, perturbed by the distance and angle of `name`.

        Raises
        ------
        InvalidInput
            The true pose of the pair is unknown.
        """
        if truth is None:
            raise InvalidInput(
                f"truth must be given for starts around it, got none for the pair {pair}; give the "
                "poses of its scans, or choose other starts"
            )
        distance, angle = self.levels[name]
        keys = (zlib.crc32(text.encode()) for text in (pair, name))
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, *keys]))
        shift, turn = rng.normal(size=3), rng.normal(size=3)
        if self.axis == "vertical":
            shift[2] *= _VERTICAL_SHARE
            turn[:2] = 0.0
        shift *= distance / np.linalg.norm(shift)
        turn *= angle / np.linalg.norm(turn)
        rotation = exp_rotation(turn) @ truth.rotation
        return Pose(rotation, truth.apply(centre) + shift - rotation @ centre)
