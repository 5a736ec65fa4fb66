"""Random smooth functions of the plane, for terrain and densities."""

from dataclasses import dataclass

import numpy as np

from scanlock.arrays import Matrix, Vector

_BLOCK = 2048
"""Number of positions that are evaluated at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """A sum of plane waves with random directions, lengths and phases.

    Attributes
    ----------
    numbers : (k, 2) [rad/m]
        Wave vectors.
    phases : (k,) [rad]
    heights : (k,) [m]
        Amplitudes.
    """

    numbers: Matrix
    phases: Vector
    heights: Vector

    @classmethod
    def drawn(
        cls, rng: np.random.Generator, deviation: float, min_length: float, max_length: float
    ) -> "Waves":
        """Draw waves of a standard deviation [m] and a range of wavelengths [m]."""
        count = 16
        lengths = np.exp(rng.uniform(np.log(min_length), np.log(max_length), count))
        angles = rng.uniform(0.0, 2.0 * np.pi, count)
        numbers = (2.0 * np.pi / lengths)[:, None] * np.column_stack(
            [np.cos(angles), np.sin(angles)]
        )
        # Amplitudes increase with wavelength, as in landscapes.
        heights = np.sqrt(lengths)
        heights *= deviation * np.sqrt(2.0) / np.linalg.norm(heights)
        return cls(numbers, rng.uniform(0.0, 2.0 * np.pi, count), heights)

    def at(self, positions: Matrix) -> Vector:
        """Return the values (n,) at (n, 2+) positions."""
        values = np.empty(len(positions))
        # Products of a million positions and all waves do not fit into the cache.
        for begin in range(0, len(positions), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            x, y = positions[rows, :1], positions[rows, 1:2]
            waves = np.sin(x * self.numbers[:, 0] + y * self.numbers[:, 1] + self.phases)
            values[rows] = (self.heights * waves).sum(axis=1)
        return values


def smoothstep(values: Vector, low: float, high: float) -> Vector:
    """Return 0 below `low`, 1 above `high`, and a cubic transition between them."""
    x = np.clip((values - low) / (high - low), 0.0, 1.0)
    return x * x * (3.0 - 2.0 * x)
