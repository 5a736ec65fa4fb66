"""Where the registrations of a study begin: at the identity, or away from it or from the truth."""

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
"""How starts err: about the vertical and nearly level as vehicles do, or any way."""

_LEVELNESS = 0.1
"""Vertical share of the shifts of vehicles."""


class StartPlan(Protocol):
    """Which starts each pair has."""

    @property
    def names(self) -> tuple[str, ...]:
        """What the starts of any pair are called, in their order."""
        ...

    @property
    def rule(self) -> str:
        """What decides a start besides its name and its pair, in a few words."""
        ...

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the start of this name for a pair, target from source.

        Parameters
        ----------
        name : str
            One of `names`.
        pair : str
            What the pair is called.
        truth : Pose, optional
            Its true pose, where it is known.
        centre : (3,) [m]
            The place in the source about which starts are turned.
        """
        ...


@dataclass(frozen=True, slots=True)
class FromIdentity:
    """Start every pair once, from no motion at all."""

    @property
    def names(self) -> tuple[str, ...]:
        """The only start."""
        return ("identity",)

    @property
    def rule(self) -> str:
        """Nothing more is to be known."""
        return "identity"

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the identity."""
        return Pose.identity()


@dataclass(frozen=True, kw_only=True, slots=True)
class Displaced:
    """Start every pair from the same stated motions, whatever the true pose is.

    A source that was moved and turned by a motion and is registered from no motion is the same
    as one that starts there.
    """

    motions: Mapping[str, Pose]
    """The start [m] of each name, turned about the middle of the source."""

    def __post_init__(self) -> None:
        if not self.motions:
            raise InvalidInput("motions must hold at least one start, got none")

    @property
    def names(self) -> tuple[str, ...]:
        """One for every motion."""
        return tuple(self.motions)

    @property
    def rule(self) -> str:
        """The motions themselves."""
        return "; ".join(
            f"{name}: {pose.matrix[:3].tolist()}" for name, pose in self.motions.items()
        )

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the motion of this name."""
        motion = self.motions[name]
        return Pose(motion.rotation, centre + motion.translation - motion.rotation @ centre)


@dataclass(frozen=True, kw_only=True, slots=True)
class AroundTruth:
    """Start every pair from poses that are wrong by known amounts, in random directions.

    Each start is the true pose, moved and turned about the middle of the source by exactly the
    stated distance and angle. It depends on the seed and the pair's name alone.
    """

    distances: tuple[float, ...] = (0.0, 1.0, 2.0, 4.0, 8.0)
    """Errors of translation [m]."""

    angles: tuple[float, ...] = tuple(math.radians(angle) for angle in (0.0, 10.0, 20.0, 40.0))
    """Errors of rotation [rad], each with every distance."""

    repeats: int = 1
    """Starts with every pair of errors."""

    axis: StartAxis = "vertical"
    """How they err."""

    seed: int = 0
    """Decides the directions."""

    def __post_init__(self) -> None:
        for name, values in (("distances", self.distances), ("angles", self.angles)):
            if not values or list(values) != sorted(set(values)):
                raise InvalidInput(f"{name} must grow from one to the next, got {values}")
            require_at_least(name, values[0], 0.0)
            require_at_least(name, values[-1], 0.0)
        if self.angles[-1] > math.pi:
            raise InvalidInput(f"angles must be at most half a turn, got {self.angles[-1]} rad")
        require_count("repeats", self.repeats)
        require_count("seed", self.seed, minimum=0)
        if self.axis not in ("vertical", "random"):
            raise InvalidInput(f"axis must be 'vertical' or 'random', got {self.axis!r}")

    @property
    def names(self) -> tuple[str, ...]:
        """One for every distance, angle and repeat."""
        return tuple(self.levels)

    @property
    def rule(self) -> str:
        """What decides a start besides its name and its pair."""
        return f"{self.axis}, seed {self.seed}"

    @property
    def levels(self) -> Mapping[str, tuple[float, float]]:
        """The distance [m] and angle [rad] of each start by its name."""
        return {
            f"{distance:g} m, {math.degrees(angle):g} deg, {repeat}": (distance, angle)
            for distance in self.distances
            for angle in self.angles
            for repeat in range(1, self.repeats + 1)
        }

    def pose(self, name: str, pair: str, truth: Pose | None, centre: Vector) -> Pose:
        """Return the true pose made wrong as `name` says.

        Raises
        ------
        InvalidInput
            The true pose of the pair is not known.
        """
        if truth is None:
            raise InvalidInput(f"starts about the true pose need one, and {pair} has none")
        distance, angle = self.levels[name]
        words = (zlib.crc32(text.encode()) for text in (pair, name))
        rng = np.random.default_rng(np.random.SeedSequence([self.seed, *words]))
        shift, turn = rng.normal(size=3), rng.normal(size=3)
        if self.axis == "vertical":
            shift[2] *= _LEVELNESS
            turn[:2] = 0.0
        shift *= distance / np.linalg.norm(shift)
        turn *= angle / np.linalg.norm(turn)
        rotation = exp_rotation(turn) @ truth.rotation
        return Pose(rotation, truth.apply(centre) + shift - rotation @ centre)
