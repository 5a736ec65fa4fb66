"""Random smooth functions of the plane, for hills, bumps and densities."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Vector


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """A sum of plane waves of random direction, length and phase: smooth, never periodic.

    Attributes
    ----------
    numbers : (k, 2) [rad/m]
        Wave vectors.
    phases : (k,) [rad]
    heights : (k,) [m]
    """

    numbers: Matrix
    phases: Vector
    heights: Vector

    @classmethod
    def drawn(
        cls, rng: np.random.Generator, deviation: float, shortest: float, longest: float
    ) -> "Waves":
        """Return waves of the given standard deviation [m] and range of wavelengths [m]."""
        count = 16
        lengths = np.exp(rng.uniform(np.log(shortest), np.log(longest), count))
        angles = rng.uniform(0.0, 2.0 * np.pi, count)
        numbers = (2.0 * np.pi / lengths)[:, None] * np.column_stack(
            [np.cos(angles), np.sin(angles)]
        )
        # Long waves are high ones, as in landscapes.
        heights = np.sqrt(lengths)
        heights *= deviation * np.sqrt(2.0) / np.linalg.norm(heights)
        return cls(numbers, rng.uniform(0.0, 2.0 * np.pi, count), heights)

    def at(self, places: Matrix) -> Vector:
        """Return the value (n,) at (n, 2+) places."""
        across = places[:, :1] * self.numbers[:, 0] + places[:, 1:2] * self.numbers[:, 1]
        return (self.heights * np.sin(across + self.phases)).sum(axis=1)


def ramp(values: Vector, low: float, high: float) -> Vector:
    """Return 0 below `low`, 1 above `high` and a smooth rise between."""
    x = np.clip((values - low) / (high - low), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
