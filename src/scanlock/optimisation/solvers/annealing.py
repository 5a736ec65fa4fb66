"""Simulated annealing over poses: a seeded search for the few minima that are worth refining.

Madhavan and Messina 2003 name it as the cure for starts beyond the basin of ICP: slow by itself,
and so best in front of it. Kirkpatrick et al. 1983 with proposals that shrink as it cools.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose

_FIRST_LOOKS = 20
"""Poses tried before the first step, whose energies tell how hot the beginning must be."""

_HEAT = 0.05
"""First temperature over the deviation of those energies. Most are of poses turned so far that
nothing fits: at a temperature like theirs a chain drifts away and never comes back."""

_SMALLEST = 0.1
"""Proposals are this share of their deviations at least, all shares up to 1 being as likely by
their logarithm: a good pose wants small steps even while large ones are still allowed."""

_BLOCKS = np.array([[1, 1, 0, 0, 0, 1], [0, 0, 1, 1, 1, 0], [1, 1, 1, 1, 1, 1]], np.float64)
"""What is proposed in turn: a motion over level ground, a tilt and lift, and all at once."""


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """A pose that no pose found near it beats.

    Attributes
    ----------
    pose : Pose
    energy : float
    """

    pose: Pose
    energy: float


@dataclass(frozen=True, kw_only=True, slots=True)
class Annealing:
    """Settings of simulated annealing."""

    horizontal: float = 4.0
    """Deviation of the first proposals along x and y [m]."""

    vertical: float = 2.0
    """The same along z [m]."""

    tilt: float = math.radians(7.0)
    """The same about x and y [rad]."""

    yaw: float = math.radians(25.0)
    """The same about z [rad]."""

    cooling: float = 0.995
    """Temperature and proposals shrink by this factor from step to step."""

    steps: int = 500
    """Poses tried by each chain."""

    chains: int = 3
    """Searches that all begin at the start; each may end in another minimum."""

    minima: int = 3
    """How many distinct minima to return, at most."""

    min_separation: float = 1.0
    """Poses nearer than this [m], rotations counted at 20 m, are one minimum."""

    seed: int = 0
    """The same seed gives the same minima, to the bit."""

    def __post_init__(self) -> None:
        for name in ("horizontal", "vertical", "min_separation"):
            require_positive(name, getattr(self, name), unit="m")
        for name in ("tilt", "yaw"):
            require_positive(name, getattr(self, name), unit="rad")
        if not 0.0 < self.cooling < 1.0:
            raise InvalidInput(f"cooling must lie between 0 and 1, got {self.cooling}")
        for name in ("steps", "chains", "minima"):
            require_count(name, getattr(self, name))
        require_count("seed", self.seed, 0)

    def search(
        self, energy: Callable[[Pose], float], start: Pose, free: Vector | None = None
    ) -> tuple[Minimum, ...]:
        """Return distinct poses of low energy, the lowest first.

        Parameters
        ----------
        energy : callable
            What to make small, at a pose.
        start : Pose
            Where every chain begins.
        free : (6,), optional
            Ones for the components of a step ``(rho, phi)`` that may change, zeros for others.
        """
        rng = np.random.default_rng(self.seed)
        flat, turn = self.horizontal, self.tilt
        deviations = np.array([flat, flat, self.vertical, turn, turn, self.yaw])
        if free is not None:
            deviations = deviations * free
        seen = list[Minimum]()
        for _ in range(self.chains):
            seen += self._chain(energy, start, deviations, rng)
        return self._distinct(seen)

    def _chain(
        self,
        energy: Callable[[Pose], float],
        start: Pose,
        deviations: Vector,
        rng: np.random.Generator,
    ) -> list[Minimum]:
        """Return the poses that a chain accepted."""
        here = Minimum(start, energy(start))
        looks = [energy(start.retract(rng.normal(0.0, deviations))) for _ in range(_FIRST_LOOKS)]
        hottest, share = _HEAT * float(np.std(looks)), 1.0
        accepted = [here]
        for step in range(self.steps):
            size = share * _SMALLEST ** rng.random()
            pose = here.pose.retract(
                size * _BLOCKS[step % len(_BLOCKS)] * rng.normal(0.0, deviations)
            )
            tried = Minimum(pose, energy(pose))
            rise, heat = tried.energy - here.energy, share * hottest
            if rise <= 0.0 or (heat > 0.0 and rng.random() < math.exp(-rise / heat)):
                here = tried
                accepted.append(here)
            share *= self.cooling
        return accepted

    def _distinct(self, seen: list[Minimum]) -> tuple[Minimum, ...]:
        kept = list[Minimum]()
        for one in sorted(seen, key=lambda minimum: minimum.energy):
            if len(kept) == self.minima:
                break
            if all(_gap(one.pose, other.pose) >= self.min_separation for other in kept):
                kept.append(one)
        return tuple(kept)


def _gap(one: Pose, other: Pose) -> float:
    metres, radians = one.distance(other)
    return math.hypot(metres, 20.0 * radians)
