"""Simulated annealing over poses: a seeded search for a few minima to refine.

Kirkpatrick et al. 1983, with proposals that shrink with the temperature. Madhavan and Messina 2003
suggest it for starts beyond the basin of convergence of ICP. It is slow, so it runs before ICP.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Vector
from scanlock.errors import InvalidInput, require_count, require_positive
from scanlock.geometry.pose import Pose

_INITIAL_SAMPLES = 20
"""Poses sampled before the first step, whose energies set the first temperature."""

_HEAT = 0.05
"""First temperature over the standard deviation of the sampled energies. Most of those poses are
rotated so far that nothing fits: with a temperature of that size a chain never returns."""

_MIN_SIZE = 0.1
"""Minimum size of a proposal relative to the current deviations; sizes up to 1 are log-uniform.
Near a good pose small steps succeed, even while large ones are still allowed."""

_BLOCKS = np.array([[1, 1, 0, 0, 0, 1], [0, 0, 1, 1, 1, 0], [1, 1, 1, 1, 1, 1]], np.float64)
"""Components of a step that are proposed alternately: x, y and yaw; z, roll and pitch; all."""

_ROTATION_SCALE = 20.0
"""Distance at which a rotation counts as a translation [m]; about the range of a scan."""


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """A pose of lower energy than all poses sampled near it.

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
    """Standard deviation of the first proposals along x and y [m]."""

    vertical: float = 2.0
    """Standard deviation of the first proposals along z [m]."""

    roll_pitch: float = math.radians(7.0)
    """Standard deviation of the first proposals about x and y [rad]."""

    yaw: float = math.radians(25.0)
    """Standard deviation of the first proposals about z [rad]."""

    cooling: float = 0.995
    """Factor of the temperature and of the proposals from step to step."""

    steps: int = 500
    """Number of steps of each chain."""

    chains: int = 3
    """Number of chains; all begin at the start, and each may end in another minimum."""

    minima: int = 3
    """Maximum number of distinct minima to return."""

    min_separation: float = 1.0
    """Minimum distance of distinct minima [m], with rotations counted at 20 m."""

    seed: int = 0
    """Seed of the random numbers; equal seeds give bitwise equal minima."""

    def __post_init__(self) -> None:
        for name in ("horizontal", "vertical", "min_separation"):
            require_positive(name, getattr(self, name), unit="m")
        for name in ("roll_pitch", "yaw"):
            require_positive(name, getattr(self, name), unit="rad")
        if not 0.0 < self.cooling < 1.0:
            raise InvalidInput(f"cooling must lie between 0 and 1, got {self.cooling}")
        for name in ("steps", "chains", "minima"):
            require_count(name, getattr(self, name))
        require_count("seed", self.seed, 0)

    def search(
        self, energy: Callable[[Pose], float], start: Pose, free: Vector | None = None
    ) -> tuple[Minimum, ...]:
        """Return distinct poses of low energy, lowest first.

        Parameters
        ----------
        energy : callable
            Function of a pose to minimise.
        start : Pose
            First pose of every chain.
        free : (6,), optional
            Ones for the free components of a step ``(rho, phi)``, zeros for locked ones.
        """
        rng = np.random.default_rng(self.seed)
        flat, turn = self.horizontal, self.roll_pitch
        deviations = np.array([flat, flat, self.vertical, turn, turn, self.yaw])
        if free is not None:
            deviations = deviations * free
        visited = list[Minimum]()
        for _ in range(self.chains):
            visited += self._chain(energy, start, deviations, rng)
        return self._distinct(visited)

    def _chain(
        self,
        energy: Callable[[Pose], float],
        start: Pose,
        deviations: Vector,
        rng: np.random.Generator,
    ) -> list[Minimum]:
        """Return the poses that a chain accepted."""
        here = Minimum(start, energy(start))
        sampled = deviations * rng.standard_normal((_INITIAL_SAMPLES, 6))
        samples = [energy(start.retract(proposal)) for proposal in sampled]
        first_temperature, cooled = _HEAT * float(np.std(samples)), 1.0
        accepted = [here]
        for step in range(self.steps):
            size = cooled * _MIN_SIZE ** rng.random()
            # `rng.normal` checks the deviations in each call, which takes six times as long.
            proposal = deviations * rng.standard_normal(6)
            pose = here.pose.retract(size * _BLOCKS[step % len(_BLOCKS)] * proposal)
            tried = Minimum(pose, energy(pose))
            rise, temperature = tried.energy - here.energy, cooled * first_temperature
            if rise <= 0.0 or (temperature > 0.0 and rng.random() < math.exp(-rise / temperature)):
                here = tried
                accepted.append(here)
            cooled *= self.cooling
        return accepted

    def _distinct(self, visited: list[Minimum]) -> tuple[Minimum, ...]:
        found = list[Minimum]()
        for one in sorted(visited, key=lambda minimum: minimum.energy):
            if len(found) == self.minima:
                break
            distances = (one.pose.scaled_distance(other.pose, _ROTATION_SCALE) for other in found)
            if all(distance >= self.min_separation for distance in distances):
                found.append(one)
        return tuple(found)
